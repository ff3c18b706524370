"""The order of the cells inside a set, which decides what a scarce budget buys.

Algorithm 1 of the paper takes cells "in ascending index" inside a set and does not say how cells
are numbered. So the order is a part of the demand here: a set is a list of cells, taken in its
order. The paper's policies list theirs by the index of `care_sim.core.grid`, row by row from the
top; these functions list the hulls and wedges of any policy in another order.
"""

from collections.abc import Sequence
from functools import cache

import numpy as np

from care_sim.base.checks import check_known
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Integers
from care_sim.core.cell_order_kernels import RANDOM, SetMargins, sort_sets
from care_sim.core.cell_sets import CellSets
from care_sim.core.defaults import CELL_ORDERS
from care_sim.core.grid import Cells
from care_sim.core.grid_stack import Grid


def reordered(
    sets: Sequence[Cells],
    order: str,
    grid: Grid,
    margins: SetMargins,
    most: int | None = None,
) -> CellSets:
    """The same sets, the cells of each listed in an `order` of `care_sim.core.defaults.CELL_ORDERS`
    but the first; only the first `most` of each, if it is given.

    A set lies on an arc of columns: from its first to its last, or, if it has cells on both sides
    of the seam at azimuth -pi, from the end of its widest gap. `columns` and the spread orders
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
