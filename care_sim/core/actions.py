"""The action of the environments: scores of the cells, which of them fire, and why.

Every action passes `fired_cells`, whatever made it: a policy's demand, a network or a mask. There
the budget is a hard cap for all of them, and the random floor, line 6 of Algorithm 1, is spent.
Lines 1 to 5 are `care_sim.core.allocation.allocate`, which a policy calls.
"""

import numpy as np
from numpy.typing import NDArray

from care_sim.core.allocation import allocate
from care_sim.core.arrays import Mask
from care_sim.core.grid import Cells
from care_sim.core.rig import Rig
from care_sim.core.types import Action, Demand

SHARES = ("not fired", "exploitation", "reserve", "floor", "chosen")
NOT_FIRED, EXPLOITATION, RESERVE, FLOOR, CHOSEN = range(len(SHARES))
"""Places in SHARES."""


def scores_of(cells: Cells, shape: tuple[int, int]) -> Action:
    """The action (E, A) that makes `fired_cells` choose `cells` (n,); the earlier, the higher."""
    scores = np.zeros(shape[0] * shape[1], np.float32)
    # From 1 down in equal steps, all above 0: the cells are fired in this order, and no others.
    scores[cells] = np.arange(len(cells), 0, -1, dtype=np.float32) / max(len(cells), 1)
    return scores.reshape(shape)


def fired_cells(scores: NDArray[np.floating] | Mask, budget: int, floor: Cells | None) -> Cells:
    """The cells that an action fires, ascending.

    They are the `budget` highest strictly positive `scores` (E, A), ties by ascending index. Where
    there are fewer, `floor` tops them up; None leaves the rest unspent.
    """
    flat = scores.ravel().astype(np.float32, copy=False)
    (chosen,) = (flat > 0).nonzero()
    if len(chosen) > budget:
        # Negated, a stable ascending sort puts the highest first and leaves ties in their order.
        chosen = chosen[np.argsort(-flat[chosen], kind="stable")[:budget]]
    elif floor is not None and len(chosen) < budget:
        # So much of the floor is enough: at most len(chosen) of these cells are taken.
        free = floor[:budget]
        chosen = np.concatenate([chosen, free[flat[free] <= 0][: budget - len(chosen)]])
    return np.sort(chosen)


def shares_of(fired: Cells, action: Action, demand: Demand | None, rig: Rig) -> NDArray[np.uint8]:
    """(E, A) the share of the budget that each of the `fired` cells came from, an index into
    `SHARES`.

    `demand` is what the policy asked for. If it is None, or not the one behind the `action`, what
    the action scored is "chosen", since more is not known.
    """
    shares = np.zeros(rig.grid.size, np.uint8)
    shares[fired] = FLOOR

    # A cell without a score of its own can only have come from the floor.
    scored = fired[np.asarray(action).ravel()[fired] > 0]
    shares[scored] = CHOSEN

    # Played again, the demand gives the same cells only if it is the one behind the action.
    if demand is not None:
        taken = allocate(demand, rig.budget, rig.reserve_fraction)
        if np.array_equal(np.sort(taken), scored):
            # Exploitation fills first, whatever the layers ask for: without them, the allocator
            # takes its cells and no others.
            first = allocate(Demand(demand.exploitation), rig.budget, rig.reserve_fraction)
            shares[taken] = RESERVE
            shares[first] = EXPLOITATION
    return shares.reshape(rig.grid.shape)
