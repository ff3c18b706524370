"""Crosstalk: a pulse of another LiDAR that a cell takes for the return of its own.

Sensors in view of each other do meet this way (Kim et al. 2015, Proc. SPIE 9504). The other one is
not in step, so its pulse arrives at any time while the cell listens: the range that it feigns is
anywhere within reach. It came one way and straight, so that it is taken for the strongest.
"""

from dataclasses import replace

import numpy as np

from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.cells.stack import Grid
from care_sim.core.conditions import ReturnSettings
from care_sim.core.types import Scan
from care_sim.sensors.annotated import NO_OBJECT, Cloud, joined
from care_sim.sensors.lidar_faults import NEAREST_M
from care_sim.sensors.sweep import RollingSweep
from care_sim.world.bullet import NO_BODY

FULL_INTENSITY = 1.0
"""What a foreign pulse is taken for."""


class Crosstalk:
    """The ghosts of a LiDAR: a share `lidar_crosstalk` of its cells has one at each keyframe.

    They are drawn once per cell, fired or not, so that every policy meets the same (common random
    numbers).
    """

    def __init__(self, grid: Grid, settings: ReturnSettings, seed: np.random.SeedSequence):
        self._grid = grid
        self._rate = settings.lidar_crosstalk
        # The same at every keyframe, and as large as the grid.
        self._spans_m = grid.reach_of(np.arange(grid.size)) - 2 * NEAREST_M
        self._sweep = RollingSweep(grid, settings.lidar_sweep_s)
        self._random = np.random.default_rng(seed)

    def over_scan(self, scan: Scan, bodies: Integers) -> tuple[Scan, Integers]:
        """A scan, and the bodies (n,) behind its returns, with the ghosts of this keyframe."""
        ghosts, ranges = self._draw()
        jammed = ghosts[scan.cells]
        strengths = scan.intensities
        if strengths is not None:
            strengths = np.where(jammed, FULL_INTENSITY, strengths)
        feigned = np.where(jammed, ranges[scan.cells], scan.ranges)
        haunted = replace(scan, ranges=feigned, intensities=strengths)
        # A ghost is one return, also where there were two.
        twice = jammed & (np.diff(scan.cells, prepend=-1) == 0)
        return haunted.take(~twice), np.where(jammed, NO_BODY, bodies)[~twice]

    def over_cloud(self, cloud: Cloud, answering: Mask) -> Cloud:
        """A cloud with the ghosts of this keyframe in those cells that are `answering` (N,)."""
        ghosts, ranges = self._draw()
        cells = np.flatnonzero(ghosts & answering)
        feigned = Cloud(
            cells,
            self._grid.points(cells, ranges[cells]),
            np.full(len(cells), NO_OBJECT),
            None if cloud.intensities is None else np.full(len(cells), FULL_INTENSITY),
            None if cloud.times is None else self._sweep.seconds(cells),
        )
        return joined([cloud.take(~ghosts[cloud.cells]), feigned])

    def _draw(self) -> tuple[Mask, Floats]:
        """(N,) which cells have a ghost at this keyframe, and (N,) how far off it seems."""
        ghosts = self._random.random(self._grid.size) < self._rate
        return ghosts, NEAREST_M + self._spans_m * self._random.random(self._grid.size)


def crosstalk_of(
    grid: Grid, settings: ReturnSettings, seed: np.random.SeedSequence
) -> Crosstalk | None:
    """The crosstalk of a LiDAR with this `seed`, if there is any. It has a stream of its own: noise
    and dropout are drawn as without it.
    """
    return Crosstalk(grid, settings, seed.spawn(1)[0]) if settings.lidar_crosstalk else None
