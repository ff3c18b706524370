"""Algorithm 1 of the paper: the shared allocator, and the only place where a budget is enforced."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import cycle, filterfalse, islice

import numpy as np
from numpy.typing import NDArray

from care_sim.errors import InvalidInput, check_number, is_number
from care_sim.grid import Cells, cell_set
from care_sim.types import Action, Demand

RESERVE_FRACTION = 0.3
"""rho, the share of the budget kept for the reserve (paper, Remark 2)."""


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
    check_number("reserve_fraction", reserve_fraction, 0, 1)
    chosen: dict[int, None] = {}
    _round_robin(demand.exploitation, round((1 - reserve_fraction) * budget), chosen)
    for layer in demand.layers:
        _round_robin(layer, budget, chosen)
    if floor is not None:
        _fill(_free(map(int, floor), chosen), budget, chosen)
    return np.fromiter(chosen, dtype=np.int64, count=len(chosen))


def _round_robin(sets: Sequence[Cells], limit: int, chosen: dict[int, None]) -> None:
    queues: Iterable[Iterator[int]] = [_free(cell_set(cells).data, chosen) for cells in sets]
    for left in range(len(sets), 0, -1):
        queues = cycle(islice(queues, left))
        _fill(map(next, queues), limit, chosen)  # ends at the limit, or at the first queue that has run dry


def _free(cells: Iterable[int], chosen: dict[int, None]) -> Iterator[int]:
    """Those of `cells` that are not chosen by the time they are asked for."""
    return filterfalse(chosen.__contains__, cells)


def _fill(cells: Iterable[int], limit: int, chosen: dict[int, None]) -> None:
    for cell in islice(cells, limit - len(chosen)):
        chosen[cell] = None


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
