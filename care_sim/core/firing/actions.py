"""The action of the environments: scores of the cells, which of them fire, and why.

Every action passes the hardware (`care_sim.core.firing`), whatever made it: a policy's demand, a
network or a mask. There the budget is a hard cap for all of them, and the random floor, line 6 of
Algorithm 1, is spent.
Lines 1 to 5 are `care_sim.core.allocation.allocate`, which a policy calls.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from care_sim.base.threads import ALONE, Threads
from care_sim.core.allocation import allocate, fill_worlds, halves_up
from care_sim.core.arrays import Integers
from care_sim.core.cells.sets import CellSets, WorldSets
from care_sim.core.grid import Cells
from care_sim.core.rig import Rig
from care_sim.core.types import Action, Demand

SHARES = ("not fired", "exploitation", "reserve", "floor", "chosen", "along")
NOT_FIRED, EXPLOITATION, RESERVE, FLOOR, CHOSEN, ALONG = range(len(SHARES))
"""Places in SHARES."""


def scores_of(cells: Cells, shape: tuple[int, int], shots: Integers | int = 1) -> Action:
    """The action (E, A) that demands `cells` (n,); the earlier, the higher. Some hardware may fire
    cells more than once (`care_sim.core.firing.base`). It fires each cell at least `shots` (n,)
    times, as far as their sum does not exceed the budget. The rest is added on top.

    An action is float32. It keeps the order of 2^23 cells of one shot, and of 2^23 / (m (m + 1)) of
    up to m shots; among more, neighbours may tie.
    """
    scores = np.zeros(shape[0] * shape[1], np.float32)
    most = shots if isinstance(shots, int) else int(shots.max(initial=1))
    # In equal steps down from `shots`, over less than 1 / (most + 1) in all: per shot, the last
    # cell has still more than the first would have if it were fired once more than it should be.
    whole = max(len(cells), 1) * (most + 1)
    steps = np.arange(len(cells), dtype=np.float32)
    scores[cells] = (shots * whole - steps) / np.float32(whole * most)
    return scores.reshape(shape)


def shares_of(fired: Cells, action: Action, demand: Demand | None, rig: Rig) -> NDArray[np.uint8]:
    """(E, A) the share of the budget that each of the `fired` cells came from, an index into
    `SHARES`.

    `demand` is the demand of the policy. If it is None, or not the one behind the `action`, what
    the action scored is "chosen", since more is not known. A cell that fires along with others of
    its unit has the share of the first of them that was demanded.
    """
    asked = np.flatnonzero(np.asarray(action).ravel() > 0)
    kinds = np.full(len(asked), CHOSEN)

    # Played again, the demand gives the same cells only if it is the one behind the action.
    if demand is not None:
        taken = allocate(demand, rig.budget, rig.reserve_fraction)
        if np.array_equal(np.sort(taken), asked):
            # Exploitation fills first, whatever the layers demand: without them, the allocator
            # takes its cells and no others.
            first = allocate(Demand(demand.exploitation), rig.budget, rig.reserve_fraction)
            asked = taken
            kinds = np.where(np.arange(len(taken)) < len(first), EXPLOITATION, RESERVE)

    # Cells that fired without a demand came from the floor, or, on hardware without a floor, fired
    # along with the rest of a window.
    unasked = FLOOR if rig.hardware.spends_floor else ALONG
    shares = np.full(rig.grid.size, NOT_FIRED, np.uint8)
    shares[fired] = np.append(kinds, unasked)[rig.hardware.credited(asked, fired)]
    return shares.reshape(rig.grid.shape)


class Allocator:
    """Algorithm 1 for so many `worlds` of a rig, and the scores of what it takes
    (`care_sim.core.firing.actions.scores_of`), in one table that is used again. The `threads` share
    the worlds.
    """

    def __init__(self, rig: Rig, worlds: int, threads: Threads = ALONE):
        self._rig = rig
        self._threads = threads
        self._all = np.ones(worlds, np.bool_)
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
        limits[:, 0] = halves_up((1 - self._rig.reserve_fraction) * budgets)
        scores = self._scores.reshape(len(self._scores), -1)
        given = sets.cells, sets.sizes, counts, limits, self._chosen, self._counts, scores
        self._threads.share(fill_worlds, self._all, *given)
        shown = self._scores.view()
        shown.flags.writeable = False
        return shown
