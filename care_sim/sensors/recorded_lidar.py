"""A LiDAR whose full scan was recorded: fired cells return their part of it, after the faults."""

from dataclasses import replace

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.conditions import LidarFaults
from care_sim.core.grid import AngularGrid, Cells
from care_sim.sensors.annotated import Cloud
from care_sim.sensors.lidar_faults import CellFaults


class RecordedLidar:
    """Hands out the returns of fired cells; `CellFaults` are applied to them."""

    def __init__(self, grid: AngularGrid, faults: LidarFaults, seed: np.random.SeedSequence):
        self.grid = grid
        self._faults = CellFaults(grid, faults, seed)

    def fire(self, cells: Cells, cloud: Cloud) -> Cloud:
        """The returns of `cells` (k,) in the recorded `cloud`, after the faults."""
        # A cell is dropped with all its returns, of which a recorded sweep may have several.
        answering = np.zeros(self.grid.size, dtype=bool)
        answering[cells] = ~self._faults.draw_lost(cells)
        returned = cloud.take(answering[cloud.cells])
        return self._noisy(returned) if self._faults.is_noisy else returned

    def peek(self, cloud: Cloud) -> Cloud:
        """What every cell would return, before noise and dropout, which stay undrawn."""
        return cloud.take(~self._faults.dead[cloud.cells])

    def ranges(self, cloud: Cloud) -> Floats:
        """(N,) the nearest return of every cell in metres, inf without one."""
        nearest = np.full(self.grid.size, np.inf)
        # Cells come ascending, so the returns of each are one stretch.
        cells, starts = np.unique(cloud.cells, return_index=True)
        nearest[cells] = np.minimum.reduceat(np.linalg.norm(cloud.points, axis=1), starts)
        return nearest

    def _noisy(self, cloud: Cloud) -> Cloud:
        # Noise is along the ray: a point moves with its range, and stays in its cell.
        ranges = np.linalg.norm(cloud.points, axis=1)
        moved = self._faults.draw_noisy(ranges, cloud.cells) / ranges
        return replace(cloud, points=cloud.points * moved[:, None])
