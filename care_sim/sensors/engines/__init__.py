"""Engines: who answers which body a ray hits, how far away, and which body a pixel shows.

`bullet` is the reference. `fast` is compiled and gives the same answers within the differences that
`make parity` measures.
"""

import inspect
from collections.abc import Callable
from typing import Protocol

from care_sim.base.checks import check_known
from care_sim.core.arrays import Floats, Integers
from care_sim.core.cells.stack import Grid
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid, Cells
from care_sim.core.pinhole import PinholeCamera
from care_sim.sensors.engines.bullet import Bullet
from care_sim.sensors.engines.fast import Fast
from care_sim.sensors.engines.heads import HeadEngines
from care_sim.world.bullet import BulletWorld, PixelWindow


class RayEngine(Protocol):
    """Casts the rays of one grid at the bodies of one world."""

    def cast(self, sensor: Frame, cells: Cells) -> tuple[Floats, Integers]:
        """Fire `cells` (n,) from the frame `sensor`.

        Returns ranges (n,) in metres, inf without a hit within the grid's reach, and body ids (n,),
        NO_BODY where there is no hit.
        """
        ...


class Engine(RayEngine, Protocol):
    """Casts rays, and draws the bodies for cameras."""

    def body_ids(self, camera: PinholeCamera, sensor: Frame, window: PixelWindow) -> Integers:
        """The id of the body that each pixel of a window of `camera` shows, NO_BODY where there is
        none; see `care_sim.world.bullet.BulletWorld.body_ids`.
        """
        ...

    def visible_boxes(self, camera: PinholeCamera, sensor: Frame, window: PixelWindow) -> Integers:
        """(n, 6) the bodies in a window of `camera` in ascending order: id; left, top, right,
        bottom of the box that holds all its pixels, counted from the corner of the picture; their
        number.
        """
        ...


ENGINES: dict[str, Callable[[BulletWorld, AngularGrid], Engine]] = {"bullet": Bullet, "fast": Fast}
"""Engine makers by name, each for the grid of one LiDAR."""


def make_engine(name: str, world: BulletWorld, grid: Grid) -> Engine:
    """The engine of a name for a world and the LiDARs of a grid."""
    make = ENGINES[name]
    return make(world, grid) if isinstance(grid, AngularGrid) else HeadEngines(make, world, grid)


def check_engine(name: str) -> None:
    """Raise InvalidInput for a name that is not an engine."""
    check_known("engine", name, ENGINES)


def engine_lines() -> list[str]:
    """One line per engine: its name and what it is."""
    abouts = {name: inspect.getdoc(made) or "" for name, made in ENGINES.items()}
    firsts = {name: about.partition("\n\n")[0] for name, about in abouts.items()}
    return [f"{name:12} {' '.join(first.split())}" for name, first in firsts.items()]


def engine_names() -> list[str]:
    """The names of engines."""
    return [*ENGINES]
