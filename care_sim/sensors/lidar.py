"""A LiDAR that fires chosen cells, and nothing else."""

from dataclasses import dataclass

import numpy as np

from care_sim.errors import check_number
from care_sim.frames import Frame, turned
from care_sim.grid import AngularGrid, Cells
from care_sim.sensors.engines import RayEngine
from care_sim.types import Scan
from care_sim.world.bullet import NOTHING, Integers

LIDAR_POSITION = (-0.445, 0.0, 1.84)
"""Metres from the ego's centre: LIDAR_TOP of nuScenes, 0.94 m before the rear axle of a Renault Zoe."""
NEAREST_M = 0.01
"""A noisy return stays this far from 0 m (not fired) and from the reach (no return)."""


@dataclass(frozen=True)
class LidarNoise:
    """Gaussian `range_sigma_m` on every return and the rate of returns lost (`dropout`)."""

    range_sigma_m: float = 0.0
    dropout: float = 0.0

    def __post_init__(self) -> None:
        check_number("lidar_dropout", self.dropout, 0, 1)
        check_number("lidar_range_sigma", self.range_sigma_m, 0)


class Lidar:
    """Casts the fired cells through a ray engine; noise draws are one a cell, fired or not, so that
    every policy meets the same noise (common random numbers).
    """

    def __init__(self, grid: AngularGrid, engine: RayEngine, noise: LidarNoise, rng: np.random.Generator):
        self.grid = grid
        self._engine = engine
        self._noise = noise
        self._rng = rng

    def peek(self, sensor: Frame) -> Scan:
        """What a scan of every cell would return, before noise, which stays undrawn."""
        directions = turned(self.grid.directions, sensor.yaw)
        ranges, _ = self._engine.cast(sensor.origin, directions, self.grid.range_m)
        return Scan(np.arange(self.grid.size), ranges)

    def fire(self, cells: Cells, sensor: Frame) -> tuple[Scan, Integers]:
        """Fire `cells` from the frame `sensor`.

        Returns the scan, and the body id behind every return for the proxy detector alone.
        """
        directions = turned(self.grid.directions[cells], sensor.yaw)
        ranges, ids = self._engine.cast(sensor.origin, directions, self.grid.range_m)
        if self._noise.range_sigma_m > 0:
            draws = self._rng.standard_normal(self.grid.size)[cells]
            noisy = np.clip(ranges + self._noise.range_sigma_m * draws, NEAREST_M, self.grid.range_m - NEAREST_M)
            ranges = np.where(np.isinf(ranges), ranges, noisy)
        if self._noise.dropout > 0:
            lost = self._rng.random(self.grid.size)[cells] < self._noise.dropout
            ranges, ids = np.where(lost, np.inf, ranges), np.where(lost, NOTHING, ids)
        return Scan(cells, ranges), ids
