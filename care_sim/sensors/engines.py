"""Ray engines behind one seam: who answers which body a cell's ray hits, and how far away."""

from collections.abc import Callable
from typing import Protocol

from care_sim.errors import unknown
from care_sim.frames import Floats, Frame
from care_sim.grid import AngularGrid, Cells
from care_sim.world.bullet import BulletWorld, Integers


class RayEngine(Protocol):
    """Casts the rays of one grid at the bodies of one world."""

    def cast(self, sensor: Frame, cells: Cells) -> tuple[Floats, Integers]:
        """Ranges (n,) in metres, inf without a hit within the grid's reach, and body ids (n,), NOTHING there, of
        `cells` (n,) fired from the frame `sensor`.
        """
        ...


class BulletRays:
    """PyBullet's own rays: the reference."""

    def __init__(self, world: BulletWorld, grid: AngularGrid):
        self._world, self._grid = world, grid

    def cast(self, sensor: Frame, cells: Cells) -> tuple[Floats, Integers]:
        """Ranges and body ids; see `RayEngine`."""
        directions = sensor.vectors_to_world(self._grid.directions[cells])
        return self._world.cast(sensor.origin, directions, self._grid.range_m)


def _fast(world: BulletWorld, grid: AngularGrid) -> RayEngine:
    from care_sim.sensors.fast import FastRays

    return FastRays(world, grid)


ENGINES: dict[str, Callable[[BulletWorld, AngularGrid], RayEngine]] = {"bullet": BulletRays, "fast": _fast}
"""Engine makers by name."""


def check_engine(name: str) -> None:
    """Raise InvalidInput for a name that is not an engine."""
    if name not in ENGINES:
        raise unknown("engine", name, ENGINES)
