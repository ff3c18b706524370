"""The order of the cells inside a set, which decides what a scarce budget buys.

Algorithm 1 of the paper takes cells "in ascending index" inside a set and does not say how cells
are numbered. So the order is a part of the demand here: a set is a list of cells, taken in its
order. The paper's policies list theirs by the index of `care_sim.core.grid`, row by row from the
top; these functions list the hulls and wedges of any policy in another order.
"""

import math
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from care_sim.base.checks import check_known
from care_sim.base.compiled import compiled
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Integers
from care_sim.core.cells.rays import MOST_COLUMNS, MOST_ROWS
from care_sim.core.cells.sets import CellSets
from care_sim.core.cells.stack import Grid
from care_sim.core.defaults import CELL_ORDERS
from care_sim.core.grid import Cells

ROWS_DOWN, ROWS_UP, COLUMNS, RANDOM, SPREAD, CORE_SPREAD = range(6)
"""The numbers of the orders."""

_TURN = 2**32
COLUMN_STEP = round(math.sqrt(2) * _TURN) % _TURN | 1
ROW_STEP = round(math.sqrt(3) * _TURN) % _TURN | 1
"""Steps of the sequence per column and per row, in parts of `_TURN`: the square roots of the first
primes, modulo 1 (Richtmyer, 1951). Whole numbers give every machine the same order, and odd ones
give different cells of a grid different numbers. Evenness was measured over eight rectangles of 4 x
6 to 10 x 40 cells. The most uneven of all windows at a corner, at any number of cells taken, is off
by 2.0 cells on average. Inverse powers of the plastic number give 2.5 to 3.0, the golden ratio and
another number 2.6 to 3.3, a random order 5.5.
"""


_CELL_BITS = (MOST_COLUMNS * MOST_ROWS - 1).bit_length()
_CELL_MASK = 2**_CELL_BITS - 1
"""The number by which a cell is sorted holds the cell in its low bits and the key in the others. So
one number is moved instead of two, and equal keys are sorted by cell."""
_SPARE = 4
"""So many cells more than are wanted are looked for: a share of a low-discrepancy sequence is off
by a few."""


class SetMargins(NamedTuple):
    """By how many cells sets were dilated: `columns` on either side, `rows` above and below."""

    columns: int
    rows: int


class _HeadRows(NamedTuple):
    """The rows of one LiDAR, `first` to `last`, amid all `rows` of `columns` cells; of its columns
    a whole `turn` would have so many.
    """

    columns: int
    rows: int
    first: int
    last: int
    turn: int


class _Arc(NamedTuple):
    """The rows and columns of a set: `width` columns from `first` on, over the seam; `upper` to
    `lower` row, both included.
    """

    first: int
    width: int
    upper: int
    lower: int


class _Room(NamedTuple):
    """Room to work in, enough for the longest set: see where each is filled."""

    keys: Integers
    numbers: Integers
    places: Integers
    sorted_numbers: Integers


@compiled()
def sort_sets(
    cells: Integers,
    sizes: Integers,
    order: int,
    columns: int,
    heads: Integers,
    margins: SetMargins,
    ranks: Integers,
    most: int,
) -> tuple[Integers, Integers]:
    """The first `most` cells of each of n sets in their order, and their sizes, as in
    `care_sim.core.cells.sets.CellSets`.

    `cells` are given set after set, and within a set LiDAR after LiDAR; `sizes` (n, heads) are
    their numbers. `heads` (heads, 3) are the first and the last row of each, and how many of its
    columns a whole turn would have; `columns` are those of all.
    """
    rows = heads[-1, 1] + 1
    whole_sizes = sizes.sum(axis=1)
    longest = 0
    for size in whole_sizes:
        longest = max(longest, size)
    listed_sizes = np.minimum(whole_sizes, most)
    listed = np.empty(listed_sizes.sum(), np.int64)
    room = _Room(
        np.empty(longest, np.int64),
        np.empty(longest + 1, np.int64),
        np.empty(longest + 1, np.int64),
        np.empty(longest, np.int64),
    )
    start = place = 0
    for n, size in enumerate(whole_sizes):
        # Every LiDAR sees the set as an arc of its own. Keys of the spread orders are shares of a
        # turn, so that sorted together all arcs are begun, and their cores, before any is done.
        early = done = 0
        for h, (first, last, turn) in enumerate(heads):
            own = slice(done, done + sizes[n, h])
            done += sizes[n, h]
            rays = _HeadRows(columns, rows, first, last, turn)
            part, keys = cells[start:][own], room.keys[own]
            early += _write_keys(part, keys, order, rays, margins, ranks)
        part = cells[start : start + size]
        start += size
        early_bound = columns * rows if order < SPREAD else _TURN
        count, below = _keep_lowest(part, early, early_bound, most, room)
        _sort(count, below, room)
        for number in room.sorted_numbers[: listed_sizes[n]]:
            listed[place] = number & _CELL_MASK
            place += 1
    return listed, listed_sizes


@compiled()
def _write_keys(
    cells: Integers,
    keys: Integers,
    order: int,
    rays: _HeadRows,
    margins: SetMargins,
    ranks: Integers,
) -> int:
    """The number by which each cell of a set comes in its order; all are of one LiDAR. Returns how
    many come early: with `core-spread` those of the core, else all.
    """
    if order == ROWS_DOWN:
        keys[: len(cells)] = cells
        return len(cells)
    if order == RANDOM:
        for n, cell in enumerate(cells):
            keys[n] = ranks[cell]
        return len(cells)
    arc = _arc(cells, rays)
    left, right, upper, lower = _core(arc, rays, margins)
    early = len(cells)
    columns, first = _short(rays.columns), _short(arc.first)
    for n in range(len(cells)):
        row, column = _row_and_column(cells[n], rays.columns)
        column = _short(column - first)
        column = _short(column + (columns if column < 0 else 0))
        if order == ROWS_UP:
            keys[n] = cells[n] + (rays.rows - 1 - 2 * row) * rays.columns
        elif order == COLUMNS:
            keys[n] = column * rays.rows + row
        else:
            # Where the sequence stands after so many steps, modulo a whole turn. The cells whose
            # number is below t lie evenly, as the share t of the plane, in any rectangle.
            keys[n] = (column * COLUMN_STEP + (row - arc.upper) * ROW_STEP) & (_TURN - 1)
            if order == CORE_SPREAD:
                in_core = right <= column < left and upper <= row < lower
                keys[n] += 0 if in_core else _TURN
                early -= not in_core
    return early


@compiled(inline="always")
def _short(number: float) -> int:
    """The whole part of a number, in 32 bits: they hold any cell, and more of them are computed at
    once.
    """
    return int(np.int32(number))


@compiled(inline="always")
def _row_and_column(cell: int, columns: int) -> tuple[int, int]:
    """Return the row and column of a cell. A multiplication is faster than a division of whole
    numbers; half a cell more keeps its last bit from mattering.
    """
    row = _short((_short(cell) + 0.5) * (1.0 / columns))
    return row, _short(cell - row * columns)


@compiled()
def _arc(cells: Integers, rays: _HeadRows) -> _Arc:
    """Where a set lies."""
    columns = rays.columns
    first, last, upper, lower = _short(columns), _short(-1), _short(rays.rows), _short(-1)
    for n in range(len(cells)):
        row, column = _row_and_column(cells[n], columns)
        first, last = min(first, column), max(last, column)
        upper, lower = min(upper, row), max(lower, row)
    begin, widest = first, columns - (last + 1 - first)

    # A set that touches the seam from both sides begins where its widest gap ends. A grid that does
    # not go all round has no seam.
    if first == 0 and last == columns - 1 and rays.turn == columns:
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
def _core(arc: _Arc, rays: _HeadRows, margins: SetMargins) -> tuple[int, int, int, int]:
    """The set without its margins: columns left and right of which it ends, counted on the arc,
    then rows; the first of each pair excluded.
    """
    # All round there is no margin. Else the middle column stays, or the two middle ones.
    side = 0 if arc.width >= rays.columns else min(margins.columns, (arc.width - 1) // 2)

    # The margin beyond the grid was cut, and the rest of it is unknown: the outermost row counts as
    # core, and so does the outermost column where the grid does not go all round. The middle stays
    # here, too.
    has_ends = rays.turn > rays.columns
    right = 0 if has_ends and arc.first == 0 else side
    left = 0 if has_ends and arc.first + arc.width == rays.columns else side
    height = arc.lower - arc.upper + 1
    inner = min(margins.rows, (height - 1) // 2)
    upper = arc.upper + (0 if arc.upper == rays.first else inner)
    lower = arc.lower + 1 - (0 if arc.lower == rays.last else inner)
    return arc.width - left, right, upper, lower


@compiled()
def _keep_lowest(
    cells: Integers, early: int, early_bound: int, most: int, room: _Room
) -> tuple[int, int]:
    """Write the numbers of at least `most` cells, those of the lowest keys, or of all if there are
    fewer. Returns how many they are, and a bound below which their keys lie.

    The keys of the `early` cells lie below `early_bound`, all others between it and twice as much.
    """
    # Keys of a low-discrepancy sequence fill the bound evenly, and a share of it holds the share of
    # the cells. In another order the first guess can be too low, and is doubled.
    wanted = min(most, len(cells))
    below = 2 * early_bound
    if wanted < early:
        below = min(early_bound, int(early_bound * ((wanted + _SPARE) / early)) + 1)
    while True:
        # Every number is written, and the next one over it if it is not kept: that needs no branch.
        kept = 0
        for n, cell in enumerate(cells):
            room.numbers[kept] = room.keys[n] << _CELL_BITS | cell
            kept += room.keys[n] < below
        if kept >= wanted:
            return kept, below
        below *= 2


@compiled()
def _sort(count: int, bound: int, room: _Room) -> None:
    """Sort the first `count` numbers, whose keys lie below `bound`."""
    # As many buckets as cells. Keys of a low-discrepancy sequence fill them evenly, so this takes a
    # time in proportion to the cells; `places[b]` counts, then holds where bucket b begins.
    room.places[: count + 1] = 0
    share = count / bound
    for number in room.numbers[:count]:
        room.places[int((number >> _CELL_BITS) * share) + 1] += 1
    for bucket in range(count):
        room.places[bucket + 1] += room.places[bucket]
    for number in room.numbers[:count]:
        bucket = int((number >> _CELL_BITS) * share)
        room.sorted_numbers[room.places[bucket]] = number
        room.places[bucket] += 1

    # Within a bucket by insertion. No cell leaves its bucket, since those before it are smaller.
    for n in range(count):
        number, place = room.sorted_numbers[n], n
        while place > 0 and room.sorted_numbers[place - 1] > number:
            room.sorted_numbers[place] = room.sorted_numbers[place - 1]
            place -= 1
        room.sorted_numbers[place] = number


def reordered(
    sets: Sequence[Cells],
    order: str,
    grid: Grid,
    margins: SetMargins,
    most: int | None = None,
) -> CellSets:
    """The same sets, the cells of each listed in an `order` of `care_sim.core.defaults.CELL_ORDERS`
    but the first; only the first `most` of each, if it is given.

    A set covers an arc of columns, from its first to its last. With cells on both sides of the seam
    at azimuth -pi, the arc begins at the end of its widest gap. `columns` and the spread orders
    count from the right end of the arc, so that the seam makes no difference. A set of several
    LiDARs has an arc for each, and a core: `columns` and the spread orders go through all of them
    at a time. Raises InvalidInput for another order, and for a cell that the grid does not have.
    """
    check_known("order", order, CELL_ORDERS[1:])
    given = CellSets.of(sets)
    size = grid.size
    if len(given.cells) and not (given.cells.min() >= 0 and given.cells.max() < size):
        raise InvalidInput(f"cells must lie in 0..{size - 1}")
    number = CELL_ORDERS.index(order) - 1
    ranks = _ranks(size if number == RANDOM else 0)
    most = len(given.cells) if most is None else most
    cells, sizes = _by_head(given, grid)
    told = grid.columns, grid.head_rows, margins, ranks, most
    return CellSets(*sort_sets(cells, sizes, number, *told))


def _by_head(sets: CellSets, grid: Grid) -> tuple[Integers, Integers]:
    """The cells of sets, those of a set one LiDAR after the other, and (n, heads) how many there
    are of each.
    """
    heads = len(grid.heads)
    if heads == 1:
        return sets.cells, sets.sizes[:, None]
    part = np.repeat(np.arange(len(sets)), sets.sizes) * heads + grid.lidars_of(sets.cells)
    sizes = np.bincount(part, minlength=len(sets) * heads)
    return sets.cells[np.argsort(part, kind="stable")], sizes.reshape(-1, heads)


@cache
def _ranks(cells: int) -> Integers:
    """A fixed permutation of the cells of a grid."""
    ranks = np.random.default_rng(0).permutation(cells)
    ranks.flags.writeable = False
    return ranks
