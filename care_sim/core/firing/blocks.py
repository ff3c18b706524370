"""Blocks of the grid: rectangles of cells, each of which fires as a whole."""

import math
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_sim.base.compiled import compiled
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.firing.base import Floor, Hardware, demanded, ranked
from care_sim.core.grid import Cells
from care_sim.core.grid_stack import Grid


class Blocks(Hardware):
    """The grid in equal blocks of `rows` x `columns` cells; the first begins at row 0 and column 0.

    A demand is projected in its own order: cell by cell, the block of the cell is taken, until the
    budget is spent. A cell whose block is taken already costs nothing. The floor, cell by cell,
    takes what is left. Raises InvalidInput for blocks that do not divide the grid.
    """

    def __init__(self, grid: Grid, rows: int, columns: int):
        # A block lies in one LiDAR: the rows of each are whole blocks.
        common = {
            "rows": math.gcd(*(head.grid.rows for head in grid.heads)),
            "columns": grid.columns,
        }
        for head in grid.heads:
            sides = (rows, head.grid.rows, "rows"), (columns, grid.columns, "columns")
            for size, whole, what in sides:
                if size < 1 or whole % size:
                    raise InvalidInput(
                        f"{what} of firing {self.name} must divide the {whole} of the grid, got "
                        f"{size}; the nearest that does is {_nearest_divisor(size, common[what])}"
                    )
        super().__init__(grid, rows * columns)
        self.rows = rows
        self.columns = columns

    @cached_property
    def unit_of(self) -> Integers:
        """(N,) the number of the block of every cell, row by row of blocks from the top."""
        rows, columns = np.divmod(np.arange(self.grid.size), self.grid.columns)
        across = self.grid.columns // self.columns
        unit_of: Integers = rows // self.rows * across + columns // self.columns
        unit_of.flags.writeable = False
        return unit_of

    def fire(self, scores: NDArray[Any], budget: int, floor: Floor, last: Cells) -> Cells:
        """The blocks of the demanded cells in their order, then those of the floor."""
        taken = np.zeros(self.units, np.bool_)
        most = budget // self.unit_cells
        count = _take(demanded(scores), self.unit_of, taken, 0, most)
        if floor is not None and count < most:
            _take(floor(), self.unit_of, taken, count, most)
        return np.flatnonzero(taken[self.unit_of])

    def best(self, worth: Floats, budget: int, last: Cells) -> Integers:
        """Any blocks can fire together."""
        return ranked(worth)[: budget // self.unit_cells]


def _nearest_divisor(size: int, whole: int) -> int:
    """The divisor of `whole` that is nearest to `size`, of two the smaller."""
    divisors = [n for n in range(1, whole + 1) if whole % n == 0]
    return min(divisors, key=lambda n: abs(n - size))


@compiled()
def _take(order: NDArray[np.integer], unit_of: Integers, taken: Mask, count: int, most: int) -> int:
    """Mark the units of the cells `order` as taken, in its order, until `most` of them are;
    `count` are before. Returns how many are afterwards.
    """
    for cell in order:
        if count == most:
            break
        unit = unit_of[cell]
        count += not taken[unit]
        taken[unit] = True
    return count
