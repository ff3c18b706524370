"""Algorithm 1 of the paper: the shared allocator, and the only place where a budget is enforced."""

from collections.abc import Iterable, Sequence
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from care_sim.errors import LARGEST, InvalidInput, check_number, is_number
from care_sim.grid import Cells, cell_indices
from care_sim.types import Action, Demand

RESERVE_FRACTION = 0.3
"""rho, the share of the budget kept for the reserve (paper, Remark 2)."""

_NO_CELLS = np.empty(0, np.int64)


def budget_cells(budget: float, cells: int) -> int:
    """B = round(beta * N) (Eq. 1). Raises InvalidInput for a fraction outside (0, 1] or without a cell."""
    if not (is_number(budget) and 0.0 < budget <= 1.0):
        raise InvalidInput(f"budget must lie in (0, 1], got {budget!r}")
    if round(budget * cells) < 1:
        raise InvalidInput(f"budget {budget} leaves no cell of {cells}; the least is {1 / cells:.2g}")
    return round(budget * cells)


def allocate(demand: Demand, budget: int, reserve_fraction: float, floor: Iterable[int] | None = None) -> Cells:
    """Choose at most `budget` cells, in order of selection.

    Exploitation sets fill at most round((1 - rho) B) cells, round-robin; then each reserve layer in
    order, round-robin, up to B; then `floor`, a permutation of all cells, up to B. Within a set cells
    are taken in ascending order, and a cell already taken costs the set no turn. rho = 0 keeps no
    reserve: layers then take only what exploitation leaves.
    """
    from care_sim.turns import in_turns

    check_number("reserve_fraction", reserve_fraction, 0, 1)
    stages: list[Sequence[Cells]] = [demand.exploitation, *demand.layers]
    limits = [round((1 - reserve_fraction) * budget)] + [budget] * (len(stages) - 1)
    sets = [cell_indices(cells) for stage in stages for cells in stage]
    cells, ends = _end_to_end(sets)
    if floor is not None:
        cells = np.concatenate([cells, np.fromiter(floor, np.int64)])
        stages, limits, ends = [*stages, [cells]], [*limits, budget], [*ends, len(cells)]
    lowest, span = _span(cells)
    last_sets = np.array([*accumulate(map(len, stages))])
    chosen: Cells = in_turns(cells - lowest, np.array(ends, np.int64), last_sets, np.array(limits), np.zeros(span, bool))
    return chosen + lowest


def _end_to_end(sets: Sequence[NDArray[np.integer]]) -> tuple[Cells, list[int]]:
    """The cells of sets one after the other, each ascending, and where each ends."""
    cells = np.concatenate([_NO_CELLS, *sets], dtype=np.int64, casting="unsafe")
    ends = [*accumulate(map(len, sets))]
    drops = np.flatnonzero(cells[1:] < cells[:-1]) + 1
    if not set(drops.tolist()) <= set(ends):
        cells = cells[np.lexsort((cells, np.repeat(np.arange(len(sets)), [*map(len, sets)])))]
    return cells, ends


def _span(cells: Cells) -> tuple[int, int]:
    """The lowest index, at most 0, and how many there are from it to the highest."""
    lowest, highest = int(cells.min(initial=0)), int(cells.max(initial=0))
    if highest - lowest > LARGEST:
        raise InvalidInput(f"cells must lie in 0..{LARGEST}, got {lowest if lowest < 0 else highest}")
    return lowest, highest - lowest + 1


def scores_of(cells: Cells, shape: tuple[int, int]) -> Action:
    """The action (E, A) that makes `fired_cells` choose `cells`, earlier ones scored higher."""
    scores = np.zeros(shape[0] * shape[1], np.float32)
    scores[cells] = np.arange(len(cells), 0, -1, dtype=np.float32) / max(len(cells), 1)
    return scores.reshape(shape)


def fired_cells(scores: NDArray[np.floating] | NDArray[np.bool_], budget: int, floor: Cells | None) -> Cells:
    """The cells an action fires, ascending: the `budget` highest strictly positive scores, ties by
    ascending index, topped up from `floor` when there are fewer (None leaves them unspent).
    """
    flat = scores.ravel().astype(np.float32, copy=False)
    chosen = np.flatnonzero(flat > 0)
    if len(chosen) > budget:
        chosen = chosen[np.argsort(-flat[chosen], kind="stable")[:budget]]
    elif floor is not None and len(chosen) < budget:
        free = floor[:budget]  # enough of it, whatever is chosen: of these at most len(chosen) are taken
        chosen = np.concatenate([chosen, free[flat[free] <= 0][: budget - len(chosen)]])
    return np.sort(chosen)
