"""A LiDAR whose full scan was recorded: fired cells return their part of it, after the faults."""

import numpy as np

from care_sim.core.conditions import LidarFaults
from care_sim.core.frames import Floats
from care_sim.core.grid import AngularGrid, Cells
from care_sim.sensors.annotated import Cloud
from care_sim.sensors.lidar import dead_cells, noisy


class RecordedLidar:
    """Hands out the returns of fired cells.

    Noise and dropout are drawn once per cell, fired or not, so that every policy meets the same
    (common random numbers).
    """

    def __init__(self, grid: AngularGrid, faults: LidarFaults, seed: np.random.SeedSequence):
        self.grid = grid
        self._faults = faults
        self._live = ~dead_cells(grid, faults.lidar_dead_rows)
        self._noise = np.random.default_rng(seed)
        self._dropout = np.random.default_rng(seed.spawn(1)[0])

    def fire(self, cells: Cells, cloud: Cloud) -> Cloud:
        """The returns of `cells` (k,) in the recorded `cloud`, after the faults."""
        # A cell is dropped with all its returns, of which a recorded sweep may have several.
        answering = np.zeros(self.grid.size, dtype=bool)
        answering[cells] = True
        answering &= self._live
        if self._faults.lidar_dropout > 0:
            answering &= self._dropout.random(self.grid.size) >= self._faults.lidar_dropout
        returned = cloud.take(answering[cloud.cells])
        if self._faults.lidar_range_sigma > 0:
            return self._noisy(returned)
        return returned

    def peek(self, cloud: Cloud) -> Cloud:
        """What every cell would return, before noise and dropout, which stay undrawn."""
        return cloud.take(self._live[cloud.cells])

    def ranges(self, cloud: Cloud) -> Floats:
        """(N,) the nearest return of every cell in metres, inf without one."""
        nearest = np.full(self.grid.size, np.inf)
        # Cells come ascending, so the returns of each are one stretch.
        cells, starts = np.unique(cloud.cells, return_index=True)
        nearest[cells] = np.minimum.reduceat(np.linalg.norm(cloud.points, axis=1), starts)
        return nearest

    def _noisy(self, cloud: Cloud) -> Cloud:
        # Noise is along the ray: a point moves with its range, and stays in its cell.
        errors = (
            self._faults.lidar_range_sigma
            * self._noise.standard_normal(self.grid.size)[cloud.cells]
        )
        ranges = np.linalg.norm(cloud.points, axis=1)
        moved = noisy(ranges, errors, self.grid.range_m) / ranges
        return Cloud(cloud.cells, cloud.points * moved[:, None], cloud.objects)
