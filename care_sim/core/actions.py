"""The action of the environments: a score per cell, the cells that it fires, and the share of the
budget of each.
"""

import numpy as np
from numpy.typing import NDArray

from care_sim.core.allocation import allocate
from care_sim.core.grid import Cells
from care_sim.core.rig import Rig
from care_sim.core.types import Action, Demand


def scores_of(cells: Cells, shape: tuple[int, int]) -> Action:
    """The action (E, A) that makes `fired_cells` choose `cells`, earlier ones scored higher."""
    scores = np.zeros(shape[0] * shape[1], np.float32)
    scores[cells] = np.arange(len(cells), 0, -1, dtype=np.float32) / max(len(cells), 1)
    return scores.reshape(shape)


def fired_cells(
    scores: NDArray[np.floating] | NDArray[np.bool_], budget: int, floor: Cells | None
) -> Cells:
    """The cells an action fires, ascending: the `budget` highest strictly positive scores, ties by
    ascending index, topped up from `floor` when there are fewer (None leaves them unspent).
    """
    flat = scores.ravel().astype(np.float32, copy=False)
    chosen = np.flatnonzero(flat > 0)
    if len(chosen) > budget:
        chosen = chosen[np.argsort(-flat[chosen], kind="stable")[:budget]]
    elif floor is not None and len(chosen) < budget:
        free = floor[
            :budget
        ]  # enough of it, whatever is chosen: of these at most len(chosen) are taken
        chosen = np.concatenate([chosen, free[flat[free] <= 0][: budget - len(chosen)]])
    return np.sort(chosen)


SHARES = ("not fired", "exploitation", "reserve", "floor", "chosen")


NOT_FIRED, EXPLOITATION, RESERVE, FLOOR, CHOSEN = range(len(SHARES))


def shares_of(fired: Cells, action: Action, demand: Demand | None, rig: Rig) -> NDArray[np.uint8]:
    """(E, A) the share of every cell, an index into `SHARES`.

    Exploitation fills first, whatever the layers ask for, so that the allocator without the layers
    tells where it ended. Without the `demand` behind the `action`, or if it is not the one behind
    it, what the action scored is no more than "chosen".
    """
    shares = np.zeros(rig.grid.size, np.uint8)
    shares[fired] = FLOOR
    scored = fired[np.asarray(action).ravel()[fired] > 0]
    shares[scored] = CHOSEN
    if demand is not None:
        taken = allocate(demand, rig.budget, rig.reserve_fraction)
        if np.array_equal(np.sort(taken), scored):
            shares[taken] = RESERVE
            shares[allocate(Demand(demand.exploitation), rig.budget, rig.reserve_fraction)] = (
                EXPLOITATION
            )
    return shares.reshape(rig.grid.shape)
