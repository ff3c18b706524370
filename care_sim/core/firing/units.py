"""Hardware that fires in units of neighbouring cells: tiles, segments of a ring, whole rows and
whole columns are all blocks.
"""

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


class Tiles(Blocks):
    """A flash sensor without moving parts, whose emitters are switched in sub-arrays."""

    name = "tiles"
    numbers = ("ROWS", "COLUMNS")
    usual = (4, 8)
    unit = "tile"
    product = "solid-state flash sensor with addressable sub-arrays of emitters"
    source = (
        "TriLumina, Progress in High-Power High-Speed VCSEL Arrays, 2016, doi 10.1117/12.2215009: "
        "sub-array regions are addressed separately"
    )


class RingSegments(Blocks):
    """A spinning sensor that is told for every channel in which sections of azimuth it fires. The
    sensor of the source knows five sections per channel, which is not held to here.
    """

    name = "segments"
    numbers = ("COLUMNS",)
    usual = (16,)
    unit = "segment"
    product = "spinning sensor with sections of azimuth for every channel"
    source = (
        "Hesai, PandarQT user manual Q01-en-2101A1, Sec. 4.3, Azimuth FOV (Sec. 4.3.3, "
        "multi-section FOV, not opened)"
    )

    def __init__(self, grid: Grid, columns: int):
        super().__init__(grid, 1, columns)


class WholeRows(Blocks):
    """A sensor with two mirrors: the fast one draws a whole line, the slow one chooses which."""

    name = "rows"
    unit = "row"
    product = "scanner with micro-mirrors that draws whole scan lines"
    source = (
        "Blickfeld, Qb2 documentation, Scan Pattern: a scan line per half swing of the horizontal "
        "mirror; their number and foveation"
    )

    def __init__(self, grid: Grid):
        super().__init__(grid, 1, grid.columns)


class WholeColumns(Blocks):
    """A line laser whose upright plane a galvanometer mirror turns. How fast the mirror turns is
    not held to here; `azimuth-window` is hardware that turns slowly. Of several LiDARs each has its
    own. Raises InvalidInput where their columns have different numbers of cells.
    """

    name = "columns"
    unit = "column"
    product = "line laser on a galvanometer mirror (light curtain)"
    source = "Wang et al., Programmable Triangulation Light Curtains, ECCV 2018"

    def __init__(self, grid: Grid):
        rows = sorted({head.grid.rows for head in grid.heads})
        if len(rows) > 1:
            raise InvalidInput(
                f"firing columns needs LiDARs of as many rows each, got {rows[0]} and {rows[-1]}"
            )
        super().__init__(grid, rows[0], 1)
