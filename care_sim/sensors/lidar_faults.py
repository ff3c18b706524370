"""Faults of a LiDAR, simulated or recorded: noise, lost returns, dead rows, crosstalk."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.cells.stack import Grid
from care_sim.core.conditions import LidarFaults, ReturnSettings
from care_sim.core.grid import Cells
from care_sim.core.types import Scan
from care_sim.sensors.annotated import NO_OBJECT, Cloud, joined, rings_of
from care_sim.sensors.beams import RollingSweep
from care_sim.world.bullet import NO_BODY

NEAREST_M = 0.01
"""A noisy return stays this far from 0 m (not fired) and from the reach (no return)."""


class CellFaults:
    """The faults of the cells of one LiDAR; `dead` (N,) are those of its dead rows.

    Noise and dropout are drawn once per cell, fired or not, so that every policy meets the same
    (common random numbers). Raises InvalidInput for a dead row that the grid does not have.
    """

    def __init__(self, grid: Grid, faults: LidarFaults, seed: np.random.SeedSequence):
        check_dead_rows(grid, faults.lidar_dead_rows)
        self.dead: Mask = np.isin(np.arange(grid.size) // grid.columns, faults.lidar_dead_rows)
        self.is_noisy = faults.lidar_range_sigma > 0
        self._grid = grid
        self._faults = faults
        self._noise = np.random.default_rng(seed)
        self._dropout = np.random.default_rng(seed.spawn(1)[0])

    def draw_noisy(self, ranges: Floats, cells: Cells, shots: Integers | None = None) -> Floats:
        """(n,) the `ranges` (n,) of `cells` (n,) as they are measured at this keyframe, metres.

        `shots` (N,) says how often every cell fires, once unless given: the mean over n shots errs
        by the root of n less.
        """
        sigma = self._faults.lidar_range_sigma
        errors = sigma * self._noise.standard_normal(self._grid.size)[cells]
        if shots is not None:
            errors /= np.sqrt(shots[cells])
        # No return stays no return: noise is that of a measured range.
        (hit,) = np.isfinite(ranges).nonzero()
        measured = ranges.copy()
        measured[hit] = noisy(ranges[hit], errors[hit], self._grid.reach_of(cells[hit]))
        return measured

    def draw_lost(self, cells: Cells) -> Mask:
        """(n,) which of `cells` (n,) return nothing at this keyframe, dead or dropped."""
        lost = self.dead[cells]
        rate = self._faults.lidar_dropout
        if rate > 0:
            lost = lost | (self._dropout.random(self._grid.size)[cells] < rate)
        return lost


def noisy(ranges: Floats, errors: Floats, reach: float | Floats) -> Floats:
    """(n,) `ranges` with `errors`, metres; the `reach` is that of all, or (n,) of each.

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


def check_dead_rows(grid: Grid, rows: Sequence[int]) -> None:
    """Raise InvalidInput for a row that the grid does not have."""
    for row in rows:
        if row >= grid.rows:
            raise InvalidInput(f"lidar_dead_rows must lie in 0..{grid.rows - 1}, got {row}")


FULL_INTENSITY = 1.0
"""What a foreign pulse is taken for."""


class Crosstalk:
    """The ghosts of a LiDAR: a share `lidar_crosstalk` of its cells has one at each keyframe.

    A ghost is a pulse of another LiDAR that a cell takes for the return of its own. Sensors in view
    of each other do meet this way (Kim et al. 2015, Proc. SPIE 9504). The other one is not in step,
    so its pulse arrives at any time while the cell listens: the range that it feigns is anywhere
    within reach. It came one way and straight, so that it is taken for the strongest.

    Ghosts are drawn once per cell, fired or not, so that every policy meets the same (common random
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
            rings=None if cloud.rings is None else rings_of(cells, self._grid),
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
