"""The engine `fast`: compiled, asking each body only about the fired cells and the pixels that it
can cover.
"""

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid, Cells
from care_sim.core.pinhole import NEAR_M, PinholeCamera
from care_sim.sensors.engines.picture_kernels import View, bodies_in_view, render_bodies
from care_sim.sensors.engines.ray_kernels import cast_rays
from care_sim.world.bullet import FAR_M, BulletWorld, PixelWindow


class Fast:
    """Compiled kernels over the same bodies; `make parity` compares them with `bullet` ray by ray.

    The first call on a machine compiles for some seconds; later processes read the compiled code
    from a cache.
    """

    def __init__(self, world: BulletWorld, grid: AngularGrid):
        self._world = world
        self._cells = grid.size
        self._reach = float(grid.range_m)
        # Read at every call: an array that is copied can be written, for which compiled code would
        # be compiled again.
        self._grid = grid
        self._tilt = grid.tilt if grid.is_tilted else None
        self._spacing = (*grid.spacing,)

    def cast(self, sensor: Frame, cells: Cells) -> tuple[Floats, Integers]:
        """Ranges and body ids; see `care_sim.sensors.engines.RayEngine`."""
        # The kernel finds the cells of a window by bisection, so it needs them ascending. Most who
        # ask have them so; for others they are sorted, and the answers put back in their order.
        if (cells[1:] < cells[:-1]).any():
            order = np.argsort(cells)
            ranges, ids = self.cast(sensor, cells[order])
            back = np.argsort(order)
            return ranges[back], ids[back]
        # One layout of the array, so that compiled code is compiled once; it checks no bounds.
        cells = np.require(cells, np.int64, ("C", "W"))
        if len(cells) and not 0 <= cells[0] <= cells[-1] < self._cells:
            raise IndexError(
                f"cells must lie in 0..{self._cells - 1}, got {cells[0]} to {cells[-1]}"
            )
        return self._cast_ascending(sensor, cells)

    def body_ids(self, camera: PinholeCamera, sensor: Frame, window: PixelWindow) -> Integers:
        """Body ids of pixels; see `care_sim.sensors.engines.Engine`."""
        return render_bodies(self._view(camera, sensor, window))

    def visible_boxes(self, camera: PinholeCamera, sensor: Frame, window: PixelWindow) -> Integers:
        """The bodies in a window; see `care_sim.sensors.engines.Engine`."""
        return bodies_in_view(self._view(camera, sensor, window))

    def _view(self, camera: PinholeCamera, sensor: Frame, window: PixelWindow) -> View:
        """What the kernels of pictures ask for."""
        world = self._world
        lens = camera.focal, camera.width / 2, camera.height / 2
        depths = NEAR_M, FAR_M
        placed = camera.stance(sensor)
        return placed, lens, window, depths, world.polyhedra.tables, world.primitives.poses

    def _cast_ascending(self, sensor: Frame, cells: Cells) -> tuple[Floats, Integers]:
        world = self._world
        # The fan is about the grid's own axes: the rays are cast from a frame that has them.
        if self._tilt is not None:
            sensor = sensor.holding(np.zeros(3), self._tilt)
        pose = (sensor.x, sensor.y, sensor.z, sensor.yaw, sensor.roll, sensor.pitch)
        return cast_rays(
            cells,
            self._reach,
            self._grid.fan,
            self._spacing,
            np.array(pose, float),
            world.primitives.tables,
            world.primitives.poses,
            world.ground,
        )
