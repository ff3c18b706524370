"""The round-robin of Algorithm 1, compiled.

Numba's cache notices a change in a compiled function's own file only, so no other file's compiled code calls these.
"""

import numpy as np
from numba import njit


@njit(cache=True)
def in_turns(cells, ends, stages, limits, taken):  # type: ignore[no-untyped-def]
    """The cells taken, in order of selection.

    Sets of `cells` lie one after the other, set s ending at `ends[s]`, stages of sets likewise, stage k ending at set
    `stages[k]`. A stage fills up to `limits[k]` cells in all. `taken` (N,), a mask over all cells, is marked.
    """
    chosen = np.empty(max(0, min(limits.max(), len(cells))), np.int64)
    places = np.empty(len(ends), np.int64)
    places[:1], places[1:] = 0, ends[:-1]
    count = first = 0
    for stage, limit in zip(stages, limits):
        count = _round_robin((cells, places, ends), np.arange(first, stage), taken, (chosen, count, limit))
        first = stage
    return chosen[:count]


@njit(cache=True)
def _round_robin(sets, waiting, taken, selection):  # type: ignore[no-untyped-def]
    """One cell a set and round, until the limit or until all sets have run dry; how many are chosen then."""
    cells, places, ends = sets
    chosen, count, limit = selection
    left = len(waiting)
    while left and count < limit:
        going = 0
        for one in waiting[:left]:
            place = places[one]
            while place < ends[one] and taken[cells[place]]:
                place += 1
            places[one] = place + 1
            if place < ends[one] and count < limit:
                taken[cells[place]], chosen[count] = True, cells[place]
                count += 1
                waiting[going] = one
                going += 1
        left = going
    return count
