"""The round-robin of Algorithm 1, compiled."""

import numpy as np

from care_sim.base.compiled import compiled


@compiled()
def survey(cells, ends):  # type: ignore[no-untyped-def]
    """Lowest (at most 0) and highest (at least 0) of the cells, and whether every set, as below, is ascending."""
    lowest = highest = start = 0
    ascending = True
    for end in ends:
        for n in range(start, end):
            lowest, highest = min(lowest, cells[n]), max(highest, cells[n])
            ascending &= n == start or cells[n - 1] <= cells[n]
        start = end
    return lowest, highest, ascending


@compiled()
def in_turns(cells, ends, stages, limits, span):  # type: ignore[no-untyped-def]
    """The cells taken, in order of selection.

    Sets of `cells` lie one after the other, set s ending at `ends[s]`, stages of sets likewise, stage k ending at set
    `stages[k]`. A stage fills up to `limits[k]` cells in all. `span` is the lowest of the cells, at most 0, and the
    highest.
    """
    lowest, highest = span
    taken = np.zeros(highest - lowest + 1, np.bool_)
    chosen = np.empty(max(0, min(limits.max(), len(cells))), np.int64)
    places = np.empty(len(ends), np.int64)
    places[:1], places[1:] = 0, ends[:-1]
    count = first = 0
    for stage, last in enumerate(stages):
        selection = chosen, count, limits[stage]
        count = _round_robin((cells, places, ends), np.arange(first, last), (taken, lowest), selection)
        first = last
    return chosen[:count]


@compiled()
def _round_robin(sets, waiting, mask, selection):  # type: ignore[no-untyped-def]
    """One cell a set and round, until the limit or until all sets have run dry; how many are chosen then."""
    cells, places, ends = sets
    taken, lowest = mask
    chosen, count, limit = selection
    left = len(waiting)
    while left and count < limit:
        going = 0
        for one in waiting[:left]:
            place = places[one]
            while place < ends[one] and taken[cells[place] - lowest]:
                place += 1
            places[one] = place + 1
            if place < ends[one] and count < limit:
                taken[cells[place] - lowest], chosen[count] = True, cells[place]
                count += 1
                waiting[going] = one
                going += 1
        left = going
    return count
