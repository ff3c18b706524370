"""A LiDAR whose full scan was recorded: fired cells return their part of it, after the faults."""

from dataclasses import replace

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.cells.stack import Grid
from care_sim.core.conditions import Sensing
from care_sim.core.firing.base import shots_by_cell
from care_sim.core.grid import Cells
from care_sim.sensors.annotated import Cloud
from care_sim.sensors.crosstalk import crosstalk_of
from care_sim.sensors.lidar_faults import CellFaults


class RecordedLidar:
    """Hands out the returns of fired cells; `CellFaults` and `Crosstalk` are applied to them."""

    def __init__(self, grid: Grid, sensing: Sensing, seed: np.random.SeedSequence):
        self.grid = grid
        self._faults = CellFaults(grid, sensing, seed)
        self._crosstalk = crosstalk_of(grid, sensing, seed)

    def fire(self, fired: Cells, cloud: Cloud) -> Cloud:
        """The returns of the ascending cells `fired` (k,) in the recorded `cloud`, after the
        faults; a cell that stands there several times was fired as often.
        """
        cells, shots = shots_by_cell(fired, self.grid.size)
        # A cell is dropped with all its returns, of which a recorded sweep may have several.
        answering = np.zeros(self.grid.size, dtype=bool)
        answering[cells] = ~self._faults.draw_lost(cells)
        returned = cloud.take(answering[cloud.cells]).to_shots(shots)
        if self._faults.is_noisy:
            returned = self._noisy(returned, shots)
        return self._crosstalk.over_cloud(returned, answering) if self._crosstalk else returned

    def peek(self, cloud: Cloud) -> Cloud:
        """What every cell would return, each fired once, before noise and dropout, which stay
        undrawn.
        """
        return cloud.take(~self._faults.dead[cloud.cells]).to_shots()

    def ranges(self, cloud: Cloud) -> Floats:
        """(N,) the nearest return of every cell in metres, inf without one."""
        nearest = np.full(self.grid.size, np.inf)
        # Cells come ascending, so the returns of each are one stretch.
        cells, starts = np.unique(cloud.cells, return_index=True)
        ranges = self.grid.ranges_to(cloud.cells, cloud.points)
        nearest[cells] = np.minimum.reduceat(ranges, starts)
        return nearest

    def _noisy(self, cloud: Cloud, shots: Integers | None) -> Cloud:
        # Noise is along the ray: a point moves with its range, and stays in its cell.
        ranges = self.grid.ranges_to(cloud.cells, cloud.points)
        moved = self._faults.draw_noisy(ranges, cloud.cells, shots) / ranges
        return replace(cloud, points=self.grid.stretched(cloud.cells, cloud.points, moved))
