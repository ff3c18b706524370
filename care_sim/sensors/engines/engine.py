"""Engines behind one seam: who answers which body a ray hits, how far away, and which body a pixel
shows.
"""

from collections.abc import Callable
from typing import Protocol

from care_sim.base.checks import check_known
from care_sim.core.frames import Floats, Frame, Integers
from care_sim.core.grid import AngularGrid, Cells
from care_sim.core.pinhole import PinholeCamera
from care_sim.world.bullet import BulletWorld, PixelWindow


class RayEngine(Protocol):
    """Casts the rays of one grid at the bodies of one world."""

    def cast(self, sensor: Frame, cells: Cells) -> tuple[Floats, Integers]:
        """Ranges (n,) in metres, inf without a hit within the grid's reach, and body ids (n,),
        NOTHING there, of `cells` (n,) fired from the frame `sensor`.
        """
        ...


class Engine(RayEngine, Protocol):
    """Also draws the bodies for cameras."""

    def body_ids(self, camera: PinholeCamera, sensor: Frame, window: PixelWindow) -> Integers:
        """Id of the body that each pixel of a window of `camera` shows, NOTHING where there is
        none; see `care_sim.world.bullet.BulletWorld.body_ids`.
        """
        ...


class Bullet:
    """PyBullet's own rays and renderer: the reference."""

    def __init__(self, world: BulletWorld, grid: AngularGrid):
        self._world, self._grid = world, grid

    def cast(self, sensor: Frame, cells: Cells) -> tuple[Floats, Integers]:
        """Ranges and body ids; see `RayEngine`."""
        directions = sensor.vectors_to_world(self._grid.directions[cells])
        return self._world.cast(sensor.origin, directions, self._grid.range_m)

    def body_ids(self, camera: PinholeCamera, sensor: Frame, window: PixelWindow) -> Integers:
        """Body ids of pixels; see `Engine`."""
        return self._world.body_ids(camera, sensor, window)


def _fast(world: BulletWorld, grid: AngularGrid) -> Engine:
    from care_sim.sensors.engines.fast import Fast

    return Fast(world, grid)


ENGINES: dict[str, Callable[[BulletWorld, AngularGrid], Engine]] = {"bullet": Bullet, "fast": _fast}
"""Engine makers by name."""


def check_engine(name: str) -> None:
    """Raise InvalidInput for a name that is not an engine."""
    check_known("engine", name, ENGINES)
