"""Algorithm 1 of the paper, compiled: sets of cells take turns, stage after stage, in one world or
in several.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Integers, Mask
from care_sim.core.grid import Cells


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
    cells: Cells,
    sizes: Integers,
    counts: Integers,
    limits: Integers,
    chosen: Cells,
    chosen_counts: Integers,
    scores: NDArray[np.float32],
) -> None:
    """Replace what is scored in `scores` (W, N), the first `chosen_counts` (W,) cells of each row
    of `chosen` (W, N), by what each world takes. Stage k of world w has `counts[w, k]` sets and
    fills up to `limits[w, k]` cells in all; worlds follow each other in every stage.
    """
    sets = _offered(cells, sizes)
    taken = np.zeros(scores.shape[1], np.bool_)
    # The first set of every stage that is yet to be served.
    firsts = counts.sum(axis=0)
    firsts = np.cumsum(firsts) - firsts
    for world in range(len(scores)):
        own = chosen[world]
        for cell in own[: chosen_counts[world]]:
            scores[world, cell] = 0
        count = _fill(sets, firsts, counts[world], limits[world], Selection(own, taken, 0))
        firsts += counts[world]
        chosen_counts[world] = count

        # The arithmetic of `care_sim.core.actions.scores_of`, in float32 as there.
        whole = np.float32(2 * max(count, 1))
        for place in range(count):
            scores[world, own[place]] = (whole - np.float32(place)) / whole
            taken[own[place]] = False


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
    # A stage goes on where the one before it stopped, with the same cells taken.
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
