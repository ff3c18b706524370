"""A LiDAR that fires chosen cells, and nothing else."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import LidarFaults
from care_sim.core.frames import Floats, Frame, Integers
from care_sim.core.grid import AngularGrid, Cells
from care_sim.core.rig import LIDAR_HEIGHT_M
from care_sim.core.types import Scan
from care_sim.sensors.engines import RayEngine
from care_sim.world.bullet import NO_BODY

LIDAR_POSITION = (-0.445, 0.0, LIDAR_HEIGHT_M)
"""Metres from the ego's centre: LIDAR_TOP of nuScenes, 0.94 m before the rear axle of a Renault
Zoe.
"""
NEAREST_M = 0.01
"""A noisy return stays this far from 0 m (not fired) and from the reach (no return)."""


class Lidar:
    """Casts the fired cells through an engine.

    Noise and dropout are drawn once per cell, fired or not, so that every policy meets the same
    (common random numbers).
    """

    def __init__(
        self,
        grid: AngularGrid,
        engine: RayEngine,
        faults: LidarFaults,
        seed: np.random.SeedSequence,
    ):
        self.grid = grid
        self._engine = engine
        self._faults = faults
        self._dead = dead_cells(grid, faults.lidar_dead_rows)
        self._noise = np.random.default_rng(seed)
        self._dropout = np.random.default_rng(seed.spawn(1)[0])

    def peek(self, sensor: Frame) -> Scan:
        """What a scan of every cell would return, before noise and dropout, which stay undrawn."""
        cells = np.arange(self.grid.size)
        ranges, _ = self._engine.cast(sensor, cells)
        return Scan(cells, np.where(self._dead, np.inf, ranges))

    def hits(self, body: int, cells: Cells, sensor: Frame) -> int:
        """How many of `cells` would hit a body, before noise and dropout, which stay undrawn."""
        _, bodies = self._engine.cast(sensor, cells)
        return int(np.count_nonzero((bodies == body) & ~self._dead[cells]))

    def fire(self, cells: Cells, sensor: Frame) -> tuple[Scan, Integers]:
        """Fire `cells` from the frame `sensor`.

        Returns the scan, and the body id behind every return for the proxy detector alone.
        """
        # Noise and dropout are drawn for every cell, and those of the fired ones taken.
        ranges, ids = self._engine.cast(sensor, cells)
        if self._faults.lidar_range_sigma > 0:
            errors = (
                self._faults.lidar_range_sigma * self._noise.standard_normal(self.grid.size)[cells]
            )
            # No return stays no return: noise is that of a measured range.
            (hit,) = np.isfinite(ranges).nonzero()
            ranges = ranges.copy()
            ranges[hit] = noisy(ranges[hit], errors[hit], self.grid.range_m)
        lost = self._dead[cells]
        if self._faults.lidar_dropout > 0:
            lost = lost | (self._dropout.random(self.grid.size)[cells] < self._faults.lidar_dropout)
        return Scan(cells, np.where(lost, np.inf, ranges)), np.where(lost, NO_BODY, ids)


def noisy(ranges: Floats, errors: Floats, reach: float) -> Floats:
    """(n,) `ranges` with `errors`, metres.

    What would come within NEAREST_M of 0 or of the reach, or beyond, is folded back. If it were cut
    instead, ranges would heap up at one number, which would tell a policy that they were cut.
    """
    erring = ranges + errors
    span = reach - 2 * NEAREST_M
    # A triangle wave: the way from the near bound to the far one and back is 2 * span long.
    beyond = np.mod(erring - NEAREST_M, 2 * span)
    folded: Floats = NEAREST_M + np.minimum(beyond, 2 * span - beyond)
    # What lies between the bounds is left to the last bit; folding would round it.
    return np.where(np.abs(erring - reach / 2) <= span / 2, erring, folded)


def dead_cells(grid: AngularGrid, rows: Sequence[int]) -> NDArray[np.bool_]:
    """(N,) mask of the cells of dead rows. Raises InvalidInput for a row that the grid does not
    have.
    """
    for row in rows:
        if row >= grid.rows:
            raise InvalidInput(f"lidar_dead_rows must lie in 0..{grid.rows - 1}, got {row}")
    return np.isin(np.arange(grid.size) // grid.columns, rows)
