"""What casts rays at the same bodies: the engines of the benchmark, and known ones beside them."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import Protocol

import numpy as np

from care_sim.base.errors import MissingExtra
from care_sim.core.arrays import Floats, Integers
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid, Cells
from care_sim.core.grid_stack import Grid
from care_sim.measure.bench.scanning.embree import Embree
from care_sim.measure.bench.scanning.mujoco import MuJoCo
from care_sim.sensors.engines import ENGINES, make_engine
from care_sim.world.bodies import BodyKind
from care_sim.world.bullet import BulletWorld


class Caster(Protocol):
    """Casts the rays of a grid at bodies of its own: the ground is 0, the others count from 1 in
    the order given.
    """

    def place(self, poses: Floats) -> None:
        """Move all bodies: (n, 3) x, y, heading."""
        ...

    def cast(self, sensor: Frame, cells: Cells) -> tuple[Floats, Integers]:
        """Ranges (n,) in metres, inf without a hit, and body ids (n,), -1 there."""
        ...


PEER_CASTERS: dict[str, Callable[[Sequence[BodyKind], AngularGrid], Caster]] = {
    "Embree (Open3D)": Embree,
    "MuJoCo": MuJoCo,
}
"""Known engines, by name. Each raises MissingExtra without its library."""


class EngineCaster:
    """An engine of the benchmark over a PyBullet world with these bodies."""

    def __init__(self, engine: str, kinds: Sequence[BodyKind], grid: Grid):
        self.world = BulletWorld()
        self._bodies = np.array([self.world.add(kind, (0.0, 0.0, 0.0)) for kind in kinds])
        self._engine = make_engine(engine, self.world, grid)

    def place(self, poses: Floats) -> None:
        """Move all bodies: (n, 3) x, y, heading."""
        self.world.move_all(self._bodies, poses)

    def cast(self, sensor: Frame, cells: Cells) -> tuple[Floats, Integers]:
        """Ranges (n,) and body ids (n,), as the engine answers."""
        return self._engine.cast(sensor, cells)


def casters(
    kinds: Sequence[BodyKind], grid: AngularGrid, opened: ExitStack
) -> tuple[dict[str, Caster], list[str]]:
    """Every engine over bodies of these kinds, by name; and in one line each, what is left out.
    `opened` frees them.
    """
    made: dict[str, Caster] = {}
    for name in ENGINES:
        caster = EngineCaster(name, kinds, grid)
        opened.callback(caster.world.close)
        made[name] = caster
    skipped = []
    for name, peer in PEER_CASTERS.items():
        try:
            made[name] = peer(kinds, grid)
        except MissingExtra as missing:
            skipped.append(f"{name}: {missing}")
    return made, skipped
