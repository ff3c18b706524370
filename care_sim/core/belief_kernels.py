"""The tables of an observation, compiled: reading them back, and what may stand in them."""

import numpy as np
from numpy.typing import NDArray

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers, Mask

SOUND, BEYOND, NO_ROW = range(3)
"""What the rows of a table can be: in order; with a number beyond the bound, or NaN; neither
padding nor of a known class."""


@compiled()
def read_rows(
    tables: NDArray[np.floating], wanted: Mask, label: int, labels: int, highest: float
) -> tuple[Floats, Integers, int]:
    """The rows (n, k) of those of the tables (W, m, k) that are `wanted` (W,) which do not begin
    with -1, which is padding, table after table; how many there are of each (W,); and whether they
    are `SOUND`.

    Numbers go up to `highest`. Rows begin with a whole number of 0 or more, and have a class below
    `labels` in the column `label`.
    """
    counts = np.zeros(len(tables), np.int64)
    for w in range(len(tables)):
        if wanted[w]:
            for m in range(tables.shape[1]):
                counts[w] += tables[w, m, 0] != -1

    rows = np.empty((counts.sum(), tables.shape[2]))
    verdict = SOUND
    n = 0
    for w in range(len(tables)):
        end, m = n + counts[w], 0
        while n < end:
            if tables[w, m, 0] != -1:
                for k in range(tables.shape[2]):
                    rows[n, k] = tables[w, m, k]
                verdict = _worse(verdict, rows[n], label, labels, highest)
                n += 1
            m += 1
    return rows, counts, verdict


@compiled()
def _worse(verdict: int, row: Floats, label: int, labels: int, highest: float) -> int:
    """The verdict on the rows so far, and one more; a number beyond the bound is the worst."""
    for number in row:
        if not -highest <= number <= highest:
            return BEYOND
    lead, own = row[0], row[label]
    known = lead >= 0 and lead == np.floor(lead) and 0 <= own < labels and own == np.floor(own)
    return verdict if known or verdict == BEYOND else NO_ROW


@compiled()
def lie_between(numbers: NDArray[np.floating], least: float, most: float) -> bool:
    """Whether all numbers (m, k) lie within these bounds, which NaN never does."""
    outside = 0
    for m in range(len(numbers)):
        for k in range(numbers.shape[1]):
            outside += not least <= numbers[m, k] <= most
    return outside == 0


@compiled()
def rows_within(rows: Floats, least: Floats, most: Floats) -> bool:
    """Whether all rows (n, k) lie between `least` (k,) and `most`, one row for all (1, k) or one
    each (n, k). NaN never does.
    """
    for n in range(len(rows)):
        upper = most[min(n, len(most) - 1)]
        for k in range(rows.shape[1]):
            if not least[k] <= rows[n, k] <= upper[k]:
                return False
    return True


@compiled()
def range_image(size: int, cells: Integers, ranges: Floats, reach: float) -> NDArray[np.float32]:
    """(N,) metres of the fired `cells` (n,), `reach` where nothing returned, 0 of cells that were
    not fired. Of a cell with several returns the first counts.
    """
    image = np.empty(size, np.float32)
    lay_ranges(image, cells, ranges, reach)
    return image


@compiled()
def lay_ranges(image: NDArray[np.float32], cells: Integers, ranges: Floats, reach: float) -> None:
    """Make `image` (N,) what `range_image` gives."""
    image[:] = 0.0
    for n in range(len(cells) - 1, -1, -1):
        image[cells[n]] = min(ranges[n], reach)
