"""Algorithm 1 of the paper, the shared allocator, and Eq. 1, the budget in cells.

Exploitation comes first, then the reserve layers, then the shared random floor. In the environments
a policy calls `allocate` for lines 1 to 5, without a floor. Line 6, the floor, and the hard cap are
those of the hardware (`care_sim.core.firing`), which every action passes, whatever made it.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_sim.base.checks import check_number, check_whole, is_number
from care_sim.base.compiled import compiled
from care_sim.base.errors import InvalidInput, shown
from care_sim.core.arrays import Integers, Mask
from care_sim.core.cells.sets import CellSets, cell_indices
from care_sim.core.grid import Cells
from care_sim.core.types import Demand


class Sets(NamedTuple):
    """Sets of cells: set s still offers `cells[next_places[s]:ends[s]]`."""

    cells: Cells
    next_places: Integers
    ends: Integers


class Selection(NamedTuple):
    """The cells chosen so far, in order, at the start of `chosen`; `taken[cell - lowest]` says of
    every cell whether it is among them.
    """

    chosen: Cells
    taken: Mask
    lowest: int


@compiled()
def bounds(cells: Cells) -> tuple[int, int]:
    """The lowest of the cells, at most 0, and the highest, at least 0."""
    lowest = highest = 0
    for cell in cells:
        lowest, highest = min(lowest, cell), max(highest, cell)
    return lowest, highest


@compiled()
def fill_stages(
    cells: Cells, sizes: Integers, counts: Integers, limits: Integers, lowest: int, highest: int
) -> Cells:
    """The cells taken, in order of selection.

    Sets of so many `sizes` lie one after the other in `cells`. Stages of sets follow each other
    likewise: stage k has `counts[k]` sets and fills up to `limits[k]` cells in all. No cell is
    lower than `lowest` (at most 0) or higher than `highest`.
    """
    taken = np.zeros(highest - lowest + 1, np.bool_)
    chosen = np.empty(max(0, min(limits.max(), len(cells))), np.int64)
    firsts = np.cumsum(counts) - counts
    count = _fill(_offered(cells, sizes), firsts, counts, limits, Selection(chosen, taken, lowest))
    return chosen[:count]


@compiled()
def fill_worlds(
    live: Mask,
    cells: Cells,
    sizes: Integers,
    counts: Integers,
    limits: Integers,
    chosen: Cells,
    chosen_counts: Integers,
    scores: NDArray[np.float32],
) -> None:
    """Replace what is scored in `scores` (W, N), the first `chosen_counts` (W,) cells of each row
    of `chosen` (W, N), by what each world takes. Worlds that are not `live` (W,) keep theirs. Stage
    k of world w has `counts[w, k]` sets and fills up to `limits[w, k]` cells in all; worlds follow
    each other in every stage.
    """
    sets = _offered(cells, sizes)
    taken = np.zeros(scores.shape[1], np.bool_)
    # The first set of every stage that is yet to be served.
    firsts = counts.sum(axis=0)
    firsts = np.cumsum(firsts) - firsts
    for world in range(len(scores)):
        if live[world]:
            own = chosen[world]
            for cell in own[: chosen_counts[world]]:
                scores[world, cell] = 0
            count = _fill(sets, firsts, counts[world], limits[world], Selection(own, taken, 0))
            chosen_counts[world] = count

            # The arithmetic of `care_sim.core.firing.actions.scores_of`, in float32 as there.
            whole = np.float32(2 * max(count, 1))
            for place in range(count):
                scores[world, own[place]] = (whole - np.float32(place)) / whole
                taken[own[place]] = False
        firsts += counts[world]


@compiled()
def _offered(cells: Cells, sizes: Integers) -> Sets:
    """Sets of which nothing is taken yet."""
    # A set offers its cells from its own start, which is where the set before it ends.
    ends = np.cumsum(sizes)
    return Sets(cells, ends - sizes, ends)


@compiled()
def _fill(
    sets: Sets, firsts: Integers, counts: Integers, limits: Integers, selection: Selection
) -> int:
    """Let stages take cells into an empty selection, and return how many. Stage k is the
    `counts[k]` sets from `firsts[k]` on, and fills up to `limits[k]` cells in all.
    """
    # A stage continues from the cells that the stage before it took.
    count = 0
    for stage in range(len(counts)):
        open_sets = np.arange(firsts[stage], firsts[stage] + counts[stage])
        count = _round_robin(sets, open_sets, selection, count, limits[stage])
    return count


@compiled()
def _round_robin(
    sets: Sets, open_sets: Integers, selection: Selection, count: int, limit: int
) -> int:
    """Take one cell per set and round, until `limit` cells are chosen or all sets have run dry.

    `open_sets` are the numbers of the sets, and are overwritten; `count` cells are chosen before.
    Returns how many are chosen afterwards.
    """
    # The first `open_count` of `open_sets` still have cells. Each pass of the loop is one round:
    # one cell of every such set, in their order.
    open_count = len(open_sets)
    while open_count and count < limit:
        served = 0
        for number in open_sets[:open_count]:
            # Cells that are already taken are passed over, and cost the set no turn.
            place = sets.next_places[number]
            end = sets.ends[number]
            while place < end and selection.taken[sets.cells[place] - selection.lowest]:
                place += 1
            sets.next_places[number] = place + 1

            # A set that gave a cell is open in the next round, in the same order. Writing it back
            # into `open_sets` is safe: `served` never overtakes the place that is being read.
            if place < end and count < limit:
                selection.taken[sets.cells[place] - selection.lowest] = True
                selection.chosen[count] = sets.cells[place]
                count += 1
                open_sets[served] = number
                served += 1
        open_count = served
    return count


HIGHEST_CELL = 2**24
"""A thousand times the cells of the paper's grid."""

_SETS = "a list of sets of cells"


def half_up(number: float) -> int:
    """The nearest whole number, of two the higher one, as people round: 2.5 is 3."""
    return math.floor(number + 0.5)


def halves_up(numbers: NDArray[np.floating]) -> Integers:
    """`half_up` of every number (n,)."""
    whole: Integers = np.floor(numbers + 0.5).astype(np.int64)
    return whole


def budget_cells(budget: float, cells: int, unit: str = "cell") -> int:
    """B = round(beta * N) (Eq. 1): the cells that a fraction `budget` of all `cells` is, or as many
    units of another hardware (`care_sim.core.firing`).

    Raises InvalidInput for a fraction outside (0, 1], and for one that leaves none.
    """
    if not (is_number(budget) and 0 < budget <= 1):
        raise InvalidInput(f"budget must lie in (0, 1], got {shown(budget)}")
    if half_up(float(budget) * cells) < 1:
        raise InvalidInput(f"budget {budget} leaves no {unit} of {cells}; {1 / cells:.2g} is one")
    return half_up(float(budget) * cells)


def allocate(
    demand: Demand,
    budget: int,
    reserve_fraction: float,
    floor: Sequence[int] | Cells | None = None,
) -> Cells:
    """Choose at most `budget` cells (n,), in order of selection (Algorithm 1).

    Exploitation sets fill at most round((1 - rho) B) cells, round-robin. Then each reserve layer in
    order fills up to B, round-robin. Then `floor`, a permutation of all cells, fills up to B; None
    leaves the rest unspent. The allocator takes the cells of a set in the order of the set
    (`care_sim.core.cells.order`). A cell that is already taken costs the set no turn. rho = 0 keeps
    no reserve: layers then take only what exploitation leaves. Raises InvalidInput for another form
    of demand or floor.
    """
    check_number("reserve_fraction", reserve_fraction, 0, 1)
    check_whole("budget", budget, 0, HIGHEST_CELL)
    stages = stages_of(demand)
    # A layer may use all that is left of B, so that it inherits what exploitation did not need.
    limits = [half_up((1 - reserve_fraction) * budget)] + [budget] * (len(stages) - 1)
    chosen = _filled(stages, limits)
    if floor is None:
        return chosen
    return np.concatenate([chosen, _free(floor, chosen, budget - len(chosen))])


def stages_of(demand: Demand) -> list[Sequence[Cells]]:
    """The sets of exploitation, then those of each reserve layer in order. Raises InvalidInput for
    another form of demand.
    """
    if not isinstance(demand, Demand):
        raise InvalidInput(f"demand must be a Demand, got {shown(demand)}")
    layers = _sequence("layers", "a list of layers", demand.layers)
    return [
        _sequence("exploitation", _SETS, demand.exploitation),
        *(_sequence("a layer", _SETS, layer) for layer in layers),
    ]


def taken_by_stage(demand: Demand, budget: int, reserve_fraction: float) -> list[Cells]:
    """The cells that each stage of a demand takes, in order of selection: exploitation, then each
    reserve layer. Joined they are what `allocate` chooses without a floor. Raises as it does.
    """
    chosen = allocate(demand, budget, reserve_fraction)
    # A stage is full before the next begins, so that without the later ones it takes the same.
    ends = [
        len(allocate(Demand(demand.exploitation, demand.layers[:count]), budget, reserve_fraction))
        for count in range(len(demand.layers))
    ]
    return np.split(chosen, ends)


def _sequence(name: str, form: str, given: Any) -> Sequence[Any]:
    """A part of a demand. Raises InvalidInput unless it is a sequence."""
    is_sequence = given.ndim if isinstance(given, np.ndarray) else isinstance(given, Sequence)
    if not is_sequence:
        raise InvalidInput(f"{name} must be {form}, got {shown(given)}")
    sequence: Sequence[Any] = given
    return sequence


def _filled(stages: Sequence[Sequence[Cells]], limits: Sequence[int]) -> Cells:
    """Stage after stage, round-robin over its sets, up to its limit in all."""
    # The sets of all stages lie in one array. A stage of the sets [3, 5] and [5, 9] and a stage of
    # the set [7] are cells [3, 5, 5, 9, 7], sizes [2, 2, 1] and counts [2, 1].
    sets = CellSets.joined([CellSets.of(stage) for stage in stages])
    counts = np.array([*map(len, stages)], np.int64)

    # A table of flags runs from the lowest to the highest cell, so its size must be bounded. The
    # grid is not known here: `care_sim.policies.base.Policy` refuses cells below 0 or beyond the
    # grid afterwards, and the table must hold them until then.
    lowest, highest = bounds(sets.cells)
    if highest - lowest > HIGHEST_CELL:
        wrong = lowest if lowest < 0 else highest
        raise InvalidInput(f"cells must lie in 0..{HIGHEST_CELL}, got {wrong}")
    most = np.array(limits, np.int64)
    return fill_stages(sets.cells, sets.sizes, counts, most, lowest, highest)


def _free(floor: Sequence[int] | Cells, chosen: Cells, count: int) -> Cells:
    """The first `count` cells of the floor that are not chosen."""
    taken = set(chosen.tolist())
    free = list[int]()
    for cell in cell_indices(floor, "floor").tolist():
        if len(free) >= count:
            break
        if cell not in taken:
            # Noted as well: a floor that names a cell twice fires it once.
            taken.add(cell)
            free.append(cell)
    return np.array(free, np.int64)
