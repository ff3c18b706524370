"""History with an undirected reserve: a fixed, evenly spread pattern."""

from functools import lru_cache

import numpy as np

from care_sim.core.belief import Belief
from care_sim.core.grid import Cells
from care_sim.core.grid_stack import Grid
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import Policy

GOLDEN = (np.sqrt(5) - 1) / 2
"""Multiples of it spread the most evenly round a circle (Kronecker sequence)."""


class HistoryUniform(Policy):
    """The control history+uniform of the paper (Sec. 5.1).

    The whole reserve, rho B cells, goes to one pattern that stays the same over the episode and
    looks nowhere in particular.
    """

    name = "history-uniform"
    source = "CARE paper, Sec. 5.1 (history+uniform)"

    def __init__(self, rig: Rig):
        super().__init__(rig)
        # What exploitation leaves, as Algorithm 1 rounds it.
        reserve = rig.budget - round((1 - rig.reserve_fraction) * rig.budget)
        self._pattern = uniform_pattern(rig.grid, reserve)

    def demand(self, belief: Belief) -> Demand:
        """Hulls, then the pattern."""
        return Demand(self.rig.hulls(belief.tracks.boxes), [[self._pattern]])


@lru_cache(maxsize=8)
def uniform_pattern(grid: Grid, count: int) -> Cells:
    """`count` different cells, ascending: as many in every row, evenly spaced. Read-only, since the
    pattern is kept for the next keyframe.

    Each row is shifted against the one above by the golden ratio of its spacing.
    """
    # The numbers go to the rows as evenly as whole numbers can. Then each one's place in its row.
    numbers = np.arange(count)
    row = numbers * grid.rows // max(count, 1)
    in_row = np.bincount(row, minlength=grid.rows)
    place = numbers - (np.cumsum(in_row) - in_row)[row]
    # Unshifted, the pattern would be a lattice with empty columns. The spacing in a row is at least
    # one column, so no cell comes twice.
    column = np.floor((place + row * GOLDEN % 1) * grid.columns / in_row[row]).astype(np.int64)
    cells: Cells = row * grid.columns + column
    cells.flags.writeable = False
    return cells
