"""The engine `fast`: compiled, asking each body only about the fired cells and the pixels that it
can cover.
"""

import numpy as np

from care_sim.core.frames import Floats, Frame, Integers
from care_sim.core.grid import AngularGrid, Cells
from care_sim.core.pinhole import NEAR_M, PinholeCamera
from care_sim.sensors.engines.picture_kernels import paint
from care_sim.sensors.engines.ray_kernels import scan
from care_sim.sensors.engines.windows import seen_from
from care_sim.world.bullet import FAR_M, BulletWorld, PixelWindow


class Fast:
    """Rays and pictures of the bodies of a world where they are at the moment; nothing is rebuilt
    when bodies move.

    The first call on a machine compiles for some seconds; later processes read the compiled code
    from a cache.
    """

    def __init__(self, world: BulletWorld, grid: AngularGrid):
        self._world, self._cells = world, grid.size
        self._rays = (grid.fan, float(grid.range_m))
        self._lattice = (grid.columns, grid.rows, float(grid.top), float(grid.row_height))

    def cast(self, sensor: Frame, cells: Cells) -> tuple[Floats, Integers]:
        """Ranges and body ids; see `care_sim.sensors.engines.RayEngine`."""
        if (cells[1:] < cells[:-1]).any():
            order = np.argsort(cells)
            ranges, ids = self.cast(sensor, cells[order])
            return ranges[np.argsort(order)], ids[np.argsort(order)]
        cells = np.require(cells, np.int64, ("C", "W"))
        if len(cells) and not 0 <= cells[0] <= cells[-1] < self._cells:
            raise IndexError(
                f"cells must lie in 0..{self._cells - 1}, got {cells[0]} to {cells[-1]}"
            )
        world, parts = self._world, self._world.primitives
        stance = np.array(
            (sensor.x, sensor.y, sensor.z, sensor.yaw, sensor.roll, sensor.pitch), float
        )
        up, centres, turns, windows = seen_from(
            stance, (parts.halves, parts.offsets, parts.owners), parts.poses, self._lattice
        )
        road, solids = (
            (up, float(sensor.z), world.ground),
            (parts.shapes, parts.halves, parts.owners),
        )
        result: tuple[Floats, Integers] = scan(
            cells, *self._rays, road, solids, (centres, turns), windows
        )
        return result

    def body_ids(self, camera: PinholeCamera, sensor: Frame, window: PixelWindow) -> Integers:
        """Body ids of pixels; see `care_sim.sensors.engines.Engine`."""
        eye, axes = camera.stance(sensor)
        lens = camera.focal, camera.width / 2, camera.height / 2
        meshes, poses = self._world.polyhedra.tables, self._world.primitives.poses
        ids: Integers = paint((eye, axes), lens, window, (NEAR_M, FAR_M), meshes, poses)
        return ids
