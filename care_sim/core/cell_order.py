"""The order of the cells inside a set, which decides what a scarce budget buys.

Algorithm 1 of the paper takes cells "in ascending index" inside a set and does not say how cells
are numbered. So the order is a part of the demand here: a set is a list of cells, taken in its
order. The paper's policies list theirs by the index of `care_sim.core.grid`, row by row from the
top; these functions list the hulls and wedges of any policy in another order.
"""

import math
from collections.abc import Sequence
from functools import cache
from itertools import accumulate, pairwise
from typing import NamedTuple

import numpy as np

from care_sim.base.checks import check_known
from care_sim.base.compiled import compiled
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Integers
from care_sim.core.grid import Cells, cell_indices
from care_sim.core.grid_kernels import GridSpacing

AS_DEMANDED = "as-demanded"
ROWS_DOWN, ROWS_UP, COLUMNS, RANDOM, SPREAD, CORE_SPREAD = range(6)
CELL_ORDERS = (
    AS_DEMANDED,
    "rows-down",
    "rows-up",
    "columns",
    "random",
    "spread",
    "core-spread",
)
"""How the cells of a set can be listed:

- `as-demanded`, as the policy lists them;
- `rows-down`, row by row from the top, `rows-up`, from the bottom, both by ascending column;
- `columns`, column by column from right to left, each from the top;
- `random`, by one permutation of the grid, the same at every keyframe and for every policy;
- `spread`, by a low-discrepancy sequence: any first few cells lie evenly over the set;
- `core-spread`, first the set without the margins by which sets are dilated, then these margins,
  both spread. A set narrower than the margins keeps its middle; on the first and last row of the
  grid there is none. A set that was dilated by less loses as much all the same.
"""

_TURN = 2**32
_COLUMN_STEP = round(math.sqrt(2) * _TURN) % _TURN | 1
_ROW_STEP = round(math.sqrt(3) * _TURN) % _TURN | 1
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


def reordered(
    sets: Sequence[Cells], order: str, spacing: GridSpacing, margins: SetMargins
) -> list[Cells]:
    """The same sets, the cells of each listed in an `order` of `CELL_ORDERS` but the first.

    A set lies on an arc of columns: from its first to its last, or, if it has cells on both sides
    of the seam at azimuth -pi, from the end of its widest gap. `columns` and the spread orders
    count from the right end of the arc, so that the seam makes no difference. Raises InvalidInput
    for another order, and for a cell that the grid does not have.
    """
    check_known("order", order, CELL_ORDERS[1:])
    arrays = [cell_indices(cells) for cells in sets]
    size = spacing.columns * spacing.rows
    cells = np.concatenate([np.empty(0, np.int64), *arrays], dtype=np.int64, casting="unsafe")
    if len(cells) and not (cells.min() >= 0 and cells.max() < size):
        raise InvalidInput(f"cells must lie in 0..{size - 1}")
    ends = np.array([*accumulate(map(len, arrays))], np.int64)
    number = CELL_ORDERS.index(order) - 1
    _sort_sets(cells, ends, number, spacing, margins, _ranks(size if number == RANDOM else 0))
    return [cells[start:end] for start, end in pairwise([0, *ends.tolist()])]


@cache
def _ranks(cells: int) -> Integers:
    """A fixed permutation of the cells of a grid."""
    ranks = np.random.default_rng(0).permutation(cells)
    ranks.flags.writeable = False
    return ranks


class _Arc(NamedTuple):
    """The rows and columns of a set: `width` columns from `first` on, over the seam; `upper` to
    `lower` row, both included.
    """

    first: int
    width: int
    upper: int
    lower: int


@compiled()
def _sort_sets(
    cells: Cells,
    ends: Integers,
    order: int,
    grid: GridSpacing,
    margins: SetMargins,
    ranks: Integers,
) -> None:
    """Sort the cells of every set in place. Sets lie one after the other, up to their `ends`."""
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
        _sort_by_keys(part, keys, bound, places, sorted_cells, sorted_keys)
        start = end


@compiled()
def _write_keys(
    cells: Cells,
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
            keys[n] = (column * _COLUMN_STEP + (row - arc.upper) * _ROW_STEP) & (_TURN - 1)
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
def _arc(cells: Cells, grid: GridSpacing) -> _Arc:
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
def _sort_by_keys(
    cells: Cells,
    keys: Integers,
    bound: int,
    places: Integers,
    sorted_cells: Cells,
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
