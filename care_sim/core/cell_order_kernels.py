"""Sorting the cells of sets, compiled; the orders are those of `care_sim.core.cell_order`."""

import math
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Integers
from care_sim.core.grid_kernels import GridSpacing

ROWS_DOWN, ROWS_UP, COLUMNS, RANDOM, SPREAD, CORE_SPREAD = range(6)
"""The numbers of the orders."""

_TURN = 2**32
COLUMN_STEP = round(math.sqrt(2) * _TURN) % _TURN | 1
ROW_STEP = round(math.sqrt(3) * _TURN) % _TURN | 1
"""Steps of the sequence per column and per row, in parts of `_TURN`: the square roots of the first
primes, modulo 1 (Richtmyer, 1951). Whole numbers give every machine the same order, and odd ones
give different cells of a grid different numbers. Over eight rectangles of 4 x 6 to 10 x 40 cells
the most uneven of all windows at a corner, at any number of cells taken, is off by 2.0 cells on
average; 2.5 to 3.0 with the inverse powers of the plastic number, 2.6 to 3.3 with the golden ratio
and another number, 5.5 at random.
"""


class SetMargins(NamedTuple):
    """By how many cells sets were dilated: `columns` on either side, `rows` above and below."""

    columns: int
    rows: int


class _Arc(NamedTuple):
    """The rows and columns of a set: `width` columns from `first` on, over the seam; `upper` to
    `lower` row, both included.
    """

    first: int
    width: int
    upper: int
    lower: int


@compiled()
def sort_sets(
    cells: Integers,
    ends: Integers,
    order: int,
    grid: GridSpacing,
    margins: SetMargins,
    ranks: Integers,
    most: int,
) -> None:
    """Put the first `most` cells of every set in their order at its beginning; what follows them
    there is of no use. Sets lie one after the other, up to their `ends`.
    """
    longest = start = 0
    for end in ends:
        longest = max(longest, end - start)
        start = end
    keys = np.empty(longest, np.int64)
    sorted_keys = np.empty(longest, np.int64)
    sorted_cells = np.empty(longest, np.int64)
    places = np.empty(longest + 1, np.int64)

    # All keys are below this bound, which the buckets of the sort share evenly.
    bound = grid.columns * grid.rows if order < SPREAD else 2 * _TURN
    start = 0
    for end in ends:
        part = cells[start:end]
        _write_keys(part, keys, order, grid, margins, ranks)
        count, below = _keep_lowest(part, keys, bound, most, places)
        _sort_by_keys(part[:count], keys, below, places, sorted_cells, sorted_keys)
        start = end


@compiled()
def _write_keys(
    cells: Integers,
    keys: Integers,
    order: int,
    grid: GridSpacing,
    margins: SetMargins,
    ranks: Integers,
) -> None:
    """The number by which each cell of a set comes in its order."""
    if order == ROWS_DOWN:
        keys[: len(cells)] = cells
        return
    if order == RANDOM:
        for n, cell in enumerate(cells):
            keys[n] = ranks[cell]
        return
    arc = _arc(cells, grid)
    left, right, upper, lower = _core(arc, grid, margins)
    for n, cell in enumerate(cells):
        row, column = _row_and_column(cell, grid.columns)
        column -= arc.first
        column += grid.columns if column < 0 else 0
        if order == ROWS_UP:
            keys[n] = cell + (grid.rows - 1 - 2 * row) * grid.columns
        elif order == COLUMNS:
            keys[n] = column * grid.rows + row
        else:
            # Where the sequence stands after so many steps, modulo a whole turn. The cells whose
            # number is below t lie evenly, as the share t of the plane, in any rectangle.
            keys[n] = (column * COLUMN_STEP + (row - arc.upper) * ROW_STEP) & (_TURN - 1)
            if order == CORE_SPREAD:
                in_core = right <= column < left and upper <= row < lower
                keys[n] += 0 if in_core else _TURN


@compiled(inline="always")
def _row_and_column(cell: int, columns: int) -> tuple[int, int]:
    """Of a cell. A multiplication is faster than a division of whole numbers; half a cell more
    keeps its last bit from mattering.
    """
    row = int((cell + 0.5) * (1.0 / columns))
    return row, cell - row * columns


@compiled()
def _arc(cells: Integers, grid: GridSpacing) -> _Arc:
    """Where a set lies."""
    columns = grid.columns
    first, last, upper, lower = columns, -1, grid.rows, -1
    for cell in cells:
        row, column = _row_and_column(cell, columns)
        first, last = min(first, column), max(last, column)
        upper, lower = min(upper, row), max(lower, row)
    if first > 0 or last < columns - 1:
        return _Arc(first, last - first + 1, upper, lower)

    # The set touches the seam from both sides: it begins where its widest gap ends.
    occupied = np.zeros(columns, np.bool_)
    for cell in cells:
        occupied[_row_and_column(cell, columns)[1]] = True
    gap = widest = begin = 0
    for column in range(columns):
        gap = 0 if occupied[column] else gap + 1
        if gap > widest:
            widest, begin = gap, column + 1
    return _Arc(begin, columns - widest, upper, lower)


@compiled()
def _core(arc: _Arc, grid: GridSpacing, margins: SetMargins) -> tuple[int, int, int, int]:
    """The set without its margins: columns left and right of which it ends, counted on the arc,
    then rows; the first of each pair excluded.
    """
    # All round there is no margin. Else the middle column stays, or the two middle ones.
    side = 0 if arc.width >= grid.columns else min(margins.columns, (arc.width - 1) // 2)

    # Rows that the margin would have beyond the grid were cut, and what is left of it is unknown:
    # the outermost row counts as core. The middle stays here, too.
    height = arc.lower - arc.upper + 1
    inner = min(margins.rows, (height - 1) // 2)
    upper = arc.upper + (0 if arc.upper == 0 else inner)
    lower = arc.lower + 1 - (0 if arc.lower == grid.rows - 1 else inner)
    return arc.width - side, side, upper, lower


@compiled()
def _keep_lowest(
    cells: Integers, keys: Integers, bound: int, most: int, places: Integers
) -> tuple[int, int]:
    """Move at least `most` cells of the lowest `keys` to the front, with their keys. Returns their
    number, and a bound below which their keys lie; `places` is room to work in.
    """
    count = len(cells)
    if count <= 2 * most:
        return count, bound

    # The lowest buckets that hold enough cells: so few cells more are kept than are asked for.
    share = count / bound
    places[: count + 1] = 0
    for n in range(count):
        places[int(keys[n] * share)] += 1
    bucket = kept = 0
    while kept < most:
        kept += places[bucket]
        bucket += 1
    below = min(int(bucket / share) + 1, bound)

    # Every cell is written, and the next one over it if it is not kept, which needs no branch.
    kept = 0
    for n in range(count):
        cells[kept] = cells[n]
        keys[kept] = keys[n]
        kept += keys[n] < below
    return kept, below


@compiled()
def _sort_by_keys(
    cells: Integers,
    keys: Integers,
    bound: int,
    places: Integers,
    sorted_cells: Integers,
    sorted_keys: Integers,
) -> None:
    """Sort cells in place by their `keys` below `bound`; the rest is room to work in."""
    # As many buckets as cells. Keys of a low-discrepancy sequence fill them evenly, so this takes
    # a time in proportion to the cells; `places[b]` counts, then tells where bucket b begins.
    count = len(cells)
    places[: count + 1] = 0
    share = count / bound
    for n in range(count):
        places[int(keys[n] * share) + 1] += 1
    for bucket in range(count):
        places[bucket + 1] += places[bucket]
    for n in range(count):
        bucket = int(keys[n] * share)
        place = places[bucket]
        places[bucket] += 1
        sorted_keys[place] = keys[n]
        sorted_cells[place] = cells[n]

    # Within a bucket by insertion. No cell leaves its bucket, since those before it are smaller.
    for n in range(count):
        key, cell, place = sorted_keys[n], sorted_cells[n], n
        while place > 0 and sorted_keys[place - 1] > key:
            sorted_keys[place] = sorted_keys[place - 1]
            sorted_cells[place] = sorted_cells[place - 1]
            place -= 1
        sorted_keys[place] = key
        sorted_cells[place] = cell
    cells[:] = sorted_cells[:count]
