"""A LiDAR that fires chosen cells, and nothing else."""

import numpy as np

from care_sim.core.arrays import Integers
from care_sim.core.conditions import LidarFaults
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid, Cells
from care_sim.core.types import Scan
from care_sim.sensors.engines import RayEngine
from care_sim.sensors.lidar_faults import CellFaults
from care_sim.world.bullet import NO_BODY


class Lidar:
    """Casts the fired cells through an engine; `CellFaults` are applied to what comes back."""

    def __init__(
        self,
        grid: AngularGrid,
        engine: RayEngine,
        faults: LidarFaults,
        seed: np.random.SeedSequence,
    ):
        self.grid = grid
        self._engine = engine
        self._faults = CellFaults(grid, faults, seed)

    def peek(self, sensor: Frame) -> Scan:
        """What a scan of every cell would return, before noise and dropout, which stay undrawn."""
        cells = np.arange(self.grid.size)
        ranges, _ = self._engine.cast(sensor, cells)
        return Scan(cells, np.where(self._faults.dead, np.inf, ranges))

    def hits(self, body: int, cells: Cells, sensor: Frame) -> int:
        """How many of `cells` would hit a body, before noise and dropout, which stay undrawn."""
        _, bodies = self._engine.cast(sensor, cells)
        return int(np.count_nonzero((bodies == body) & ~self._faults.dead[cells]))

    def fire(self, cells: Cells, sensor: Frame) -> tuple[Scan, Integers]:
        """Fire `cells` from the frame `sensor`.

        Returns the scan, and the body id behind every return for the proxy detector alone.
        """
        ranges, ids = self._engine.cast(sensor, cells)
        if self._faults.is_noisy:
            ranges = self._faults.draw_noisy(ranges, cells)
        lost = self._faults.draw_lost(cells)
        return Scan(cells, np.where(lost, np.inf, ranges)), np.where(lost, NO_BODY, ids)
