"""Algorithm 1 of the paper: the shared allocator, and the only place where a budget is enforced."""

from collections.abc import Sequence
from itertools import accumulate
from typing import Any

import numpy as np

from care_sim.base.checks import check_number, check_whole, is_number
from care_sim.base.errors import InvalidInput
from care_sim.base.text import shown
from care_sim.core.grid import Cells, cell_indices
from care_sim.core.types import Demand

RESERVE_FRACTION = 0.3
"""rho, the share of the budget kept for the reserve (paper, Remark 2)."""
HIGHEST_CELL = 2**24
"""A thousand times the cells of the paper's grid."""

SETS = "a list of sets of cells"
_NO_CELLS = np.empty(0, np.int64)


def budget_cells(budget: float, cells: int) -> int:
    """B = round(beta * N) (Eq. 1). Raises InvalidInput for a fraction outside (0, 1] or without a cell."""
    if not (is_number(budget) and 0 < budget <= 1):
        raise InvalidInput(f"budget must lie in (0, 1], got {shown(budget)}")
    if round(float(budget) * cells) < 1:
        raise InvalidInput(f"budget {budget} leaves no cell of {cells}; the least is {1 / cells:.2g}")
    return round(float(budget) * cells)


def allocate(demand: Demand, budget: int, reserve_fraction: float, floor: Sequence[int] | Cells | None = None) -> Cells:
    """Choose at most `budget` cells, in order of selection.

    Exploitation sets fill at most round((1 - rho) B) cells, round-robin; then each reserve layer in
    order, round-robin, up to B; then `floor`, a permutation of all cells, up to B. Within a set cells
    are taken in ascending order, and a cell already taken costs the set no turn. rho = 0 keeps no
    reserve: layers then take only what exploitation leaves. Raises InvalidInput for another
    form of demand or floor.
    """
    check_number("reserve_fraction", reserve_fraction, 0, 1)
    check_whole("budget", budget, 0, HIGHEST_CELL)
    if not isinstance(demand, Demand):
        raise InvalidInput(f"demand must be a Demand, got {shown(demand)}")
    layers = _listed("layers", "a list of layers", demand.layers)
    stages = [_listed("exploitation", SETS, demand.exploitation), *(_listed("a layer", SETS, one) for one in layers)]
    limits = [round((1 - reserve_fraction) * budget)] + [budget] * len(layers)
    chosen = _in_turns(stages, limits)
    return chosen if floor is None else np.concatenate([chosen, _free(floor, chosen, budget - len(chosen))])


def _listed(name: str, form: str, given: Any) -> Sequence[Any]:
    """What a demand holds there. Raises InvalidInput unless it is a sequence."""
    if not (given.ndim if isinstance(given, np.ndarray) else isinstance(given, Sequence)):
        raise InvalidInput(f"{name} must be {form}, got {shown(given)}")
    sequence: Sequence[Any] = given
    return sequence


def _in_turns(stages: Sequence[Sequence[Cells]], limits: Sequence[int]) -> Cells:
    """Stage after stage, round-robin over its sets up to its limit in all."""
    from care_sim.core.allocation_kernels import in_turns, survey

    sets = [cell_indices(cells) for stage in stages for cells in stage]
    cells = np.concatenate([_NO_CELLS, *sets], dtype=np.int64, casting="unsafe")
    ends = np.array([*accumulate(map(len, sets))], np.int64)
    lowest, highest, ascending = survey(cells, ends)
    if highest - lowest > HIGHEST_CELL:
        raise InvalidInput(f"cells must lie in 0..{HIGHEST_CELL}, got {lowest if lowest < 0 else highest}")
    if not ascending:
        cells = np.concatenate([np.sort(part) for part in np.split(cells, ends)])
    last_sets = np.array([*accumulate(map(len, stages))], np.int64)
    chosen: Cells = in_turns(cells, ends, last_sets, np.array(limits, np.int64), (lowest, highest))
    return chosen


def _free(floor: Sequence[int] | Cells, chosen: Cells, count: int) -> Cells:
    """The first `count` cells of the floor that are not chosen."""
    taken, free = set(chosen.tolist()), list[int]()
    for cell in cell_indices(floor, "floor").tolist():
        if len(free) >= count:
            break
        if cell not in taken:
            taken.add(cell)
            free.append(cell)
    return np.array(free, np.int64)


class RandomFloor:
    """Number 0 is the seed's own floor, the others are drawn from its children."""

    def __init__(self, seed: np.random.SeedSequence, number: int, cells: int):
        children = (number - 1,) if number else ()
        own = np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, *children))
        self._rng, self._cells = np.random.default_rng(own), cells

    def next(self) -> Cells:
        """The floor of the coming keyframe; to be drawn at every one, spent or not."""
        return self._rng.permutation(self._cells)
