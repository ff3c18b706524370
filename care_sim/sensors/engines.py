"""Ray engines behind one seam: who answers which body a ray hits, and how far away."""

from collections.abc import Callable
from typing import Protocol

from care_sim.errors import unknown
from care_sim.frames import Floats
from care_sim.world.bullet import BulletWorld, Integers


class RayEngine(Protocol):
    """Casts rays at the bodies of one world."""

    def cast(self, origin: Floats, directions: Floats, reach: float) -> tuple[Floats, Integers]:
        """Ranges (n,) in metres, inf without a hit, and body ids (n,), -1 there.

        `origin` (3,) and unit `directions` (n, 3) are in the world frame.
        """
        ...


def _bullet(world: BulletWorld) -> RayEngine:
    return world


ENGINES: dict[str, Callable[[BulletWorld], RayEngine]] = {"bullet": _bullet}
"""Engine makers by name."""


def check_engine(name: str) -> None:
    """Raise InvalidInput for a name that is not an engine."""
    if name not in ENGINES:
        raise unknown("engine", name, ENGINES)
