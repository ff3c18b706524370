"""The shared allocator over many worlds: Algorithm 1 of the paper for all of them at once."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from care_sim.core.allocation_kernels import fill_worlds
from care_sim.core.arrays import Integers
from care_sim.core.cell_sets import CellSets
from care_sim.core.rig import Rig
from care_sim.core.world_sets import WorldSets


class Allocator:
    """Algorithm 1 for so many `worlds` of a rig, and the scores of what it takes
    (`care_sim.core.actions.scores_of`), in one table that is used again.
    """

    def __init__(self, rig: Rig, worlds: int):
        self._rig = rig
        self._scores = np.zeros((worlds, *rig.grid.shape), np.float32)
        # Memory is taken for what is written alone.
        self._chosen = np.empty((worlds, rig.grid.size), np.int64)
        self._counts = np.zeros(worlds, np.int64)

    def scores(self, stages: Sequence[WorldSets], budgets: Integers) -> NDArray[np.float32]:
        """(W, E, A) the scores of the cells that `care_sim.core.allocation.allocate` chooses of
        each world's sets, those of exploitation and of each layer in order, with the `budgets`
        (W,). They are read-only, and the next call overwrites them.
        """
        sets = CellSets.joined([stage.sets for stage in stages])
        counts = np.stack([stage.counts for stage in stages], axis=1)
        limits = np.repeat(budgets[:, None], len(stages), axis=1)
        limits[:, 0] = np.rint((1 - self._rig.reserve_fraction) * budgets)
        scores = self._scores.reshape(len(self._scores), -1)
        fill_worlds(sets.cells, sets.sizes, counts, limits, self._chosen, self._counts, scores)
        shown = self._scores.view()
        shown.flags.writeable = False
        return shown
