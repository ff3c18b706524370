"""What scores of sectors ask of the shared allocator, and what it then fires, in any number of
worlds.
"""

from functools import cached_property
from itertools import accumulate, pairwise

import numpy as np
from numpy.typing import NDArray

from care_sim.core.arrays import Integers
from care_sim.core.cells.sets import CellSets, WorldSets
from care_sim.core.firing.actions import Allocator
from care_sim.core.grid import Cells
from care_sim.core.observation.beliefs import Beliefs
from care_sim.core.rig import Rig
from care_sim.core.types import Action
from care_sim.policies.learned.tiling import Tiling, enough_beside_hulls


class SectorChoice:
    """The stages of Algorithm 1 for scores (W, ...) of the `sectors` of W worlds. All sets are
    listed in the rig's `cell_order` already.
    """

    def __init__(self, rig: Rig, sectors: Tiling):
        self._rig = rig
        self._sectors = sectors

    def reserve(self, beliefs: Beliefs, scores: NDArray[np.floating]) -> list[WorldSets]:
        """The forecasts' hulls, then the sectors with a positive score as layers of the reserve,
        best first.
        """
        return [self.hulls(beliefs), *self._layers(scores, enough_beside_hulls(self._rig.budget))]

    def alone(self, scores: NDArray[np.floating]) -> list[WorldSets]:
        """The sectors with a positive score alone, best first."""
        return [WorldSets.nothing(len(scores)), *self._layers(scores, self._rig.budget)]

    def hulls(self, beliefs: Beliefs) -> WorldSets:
        """The hulls of the forecasts."""
        hulls = beliefs.hulls
        return WorldSets(self._rig.listed(hulls.sets), hulls.counts)

    def best(self, scores: NDArray[np.floating], enough: Integers) -> WorldSets:
        """Of each world one set, the cells of the sectors with a positive score, best first, up to
        the one that makes them `enough` (W,). One set gives in turn what a layer for each sector
        would.
        """
        tile = self._sectors.cells.shape[1]
        ranked, counts = self._sectors.ranked(scores, int(enough.max()))
        counts = np.minimum(counts, -(-enough // tile))
        cells = self._listed[ranked[np.arange(ranked.shape[1]) < counts[:, None]]]
        return WorldSets(CellSets(cells.ravel(), counts * tile), np.ones(len(counts), np.int64))

    def _layers(self, scores: NDArray[np.floating], enough: int) -> list[WorldSets]:
        """The best sector of every world that has one, then the next of each, and so on."""
        ranked, counts = self._sectors.ranked(scores, enough)
        has = np.arange(counts.max(initial=0))[:, None] < counts
        cells = self._listed[ranked.T[: len(has)][has]]
        sizes = np.full(*cells.shape)
        ends = accumulate(np.count_nonzero(has, axis=1).tolist(), initial=0)
        return [
            WorldSets(CellSets(cells[first:last].ravel(), sizes[first:last]), told)
            for (first, last), told in zip(pairwise(ends), has.astype(np.int64), strict=True)
        ]

    @cached_property
    def _listed(self) -> Cells:
        """(sectors, n) the cells of every sector in the order in which they are taken."""
        cells = self._sectors.cells
        return self._rig.listed(list(cells)).cells.reshape(cells.shape)


class SectorActions:
    """The actions (W, E, A) for scores (W, ...) of the `sectors` of W worlds, each with its own of
    the `budgets` (W,). They are read-only, and the next call overwrites them.
    """

    def __init__(self, rig: Rig, sectors: Tiling, budgets: Integers):
        self._choice = SectorChoice(rig, sectors)
        self._allocator = Allocator(rig, len(budgets))
        self._budgets = budgets

    def reserve(self, beliefs: Beliefs, scores: NDArray[np.floating]) -> Action:
        """See `SectorChoice.reserve`; each world with the budget that it is told."""
        budgets = beliefs.budgets
        best = self._choice.best(scores, enough_beside_hulls(budgets))
        return self._allocator.scores([self._choice.hulls(beliefs), best], budgets)

    def alone(self, scores: NDArray[np.floating]) -> Action:
        """See `SectorChoice.alone`."""
        best = self._choice.best(scores, self._budgets)
        return self._allocator.scores([WorldSets.nothing(len(scores)), best], self._budgets)
