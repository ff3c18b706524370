"""What goes wrong with a LiDAR, simulated or recorded: noise, lost returns, dead rows."""

from collections.abc import Sequence

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.cells.stack import Grid
from care_sim.core.conditions import LidarFaults
from care_sim.core.grid import Cells

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
