"""The engine `bullet`: PyBullet's own rays and renderer, the reference for every other engine."""

from care_sim.core.arrays import Floats, Integers
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid, Cells
from care_sim.core.pinhole import PinholeCamera
from care_sim.sensors.engines.box_kernels import boxes_of_window
from care_sim.world.bullet import BulletWorld, PixelWindow


class Bullet:
    """The rays and pictures of PyBullet: the reference, about 20 times slower than `fast`."""

    def __init__(self, world: BulletWorld, grid: AngularGrid):
        self._world = world
        self._grid = grid

    def cast(self, sensor: Frame, cells: Cells) -> tuple[Floats, Integers]:
        """Ranges and body ids; see `care_sim.sensors.engines.RayEngine`."""
        directions = sensor.vectors_to_world(self._grid.directions[cells])
        return self._world.cast(sensor.origin, directions, self._grid.range_m)

    def body_ids(self, camera: PinholeCamera, sensor: Frame, window: PixelWindow) -> Integers:
        """Body ids of pixels; see `care_sim.sensors.engines.Engine`."""
        return self._world.body_ids(camera, sensor, window)

    def visible_boxes(self, camera: PinholeCamera, sensor: Frame, window: PixelWindow) -> Integers:
        """The bodies in a window; see `care_sim.sensors.engines.Engine`."""
        return boxes_of_window(self.body_ids(camera, sensor, window), window)
