"""Hardware that fires neighbouring cells together: equal blocks, or a window."""

import math
from abc import abstractmethod
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_sim.base.checks import check_number
from care_sim.base.compiled import compiled
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers
from care_sim.core.cells.stack import Grid
from care_sim.core.firing.base import Hardware, demanded, ranked, take_units, top_up
from care_sim.core.firing.floor import Floor
from care_sim.core.grid import Cells


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

    def fire(self, scores: NDArray[Any], budget: int, floor: Floor | None, last: Cells) -> Cells:
        """The blocks of the demanded cells in their order, then those of the floor."""
        taken = np.zeros(self.units, np.bool_)
        most = min(budget // self.unit_cells, self.units)
        count = take_units(demanded(scores), self.unit_of, taken, 0, most)
        if floor is not None:
            top_up(floor, self.unit_of, taken, count, most)
        return np.flatnonzero(taken[self.unit_of])

    def best(self, worth: Floats, budget: int, last: Cells) -> Integers:
        """Any blocks can fire together."""
        return ranked(worth)[: budget // self.unit_cells]


def _nearest_divisor(size: int, whole: int) -> int:
    """The divisor of `whole` that is nearest to `size`, of two the smaller."""
    divisors = [n for n in range(1, whole + 1) if whole % n == 0]
    return min(divisors, key=lambda n: abs(n - size))


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
    """A spinning sensor that fires in chosen sections of azimuth, chosen per channel. The sensor of
    the source has five sections per channel; this one has no such limit.
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
    """A line laser whose upright plane a galvanometer mirror turns. The speed of the mirror is not
    limited; `azimuth-window` is hardware that turns slowly. Each of several LiDARs has its own
    plane. Raises InvalidInput where their columns have different numbers of cells.
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


class Window(Hardware):
    """A window over neighbouring units, as wide as the budget.

    A demand is projected in its own order: cell by cell, the window is held to places that hold the
    cell as well as those before it. A cell that no such place holds is passed over, as is one out
    of reach. The window takes the nearest of the places that are left, so it stays if nothing is
    demanded. It always fires as a whole: nothing is left for the floor. Raises InvalidInput for
    several LiDARs.
    """

    spends_floor = False

    def __init__(self, grid: Grid, unit_cells: int):
        # Hardware does not share a budget among the windows of several LiDARs.
        if len(grid.heads) > 1:
            raise InvalidInput(
                f"firing {self.name} is the window of one LiDAR, and the set-up has "
                f"{len(grid.heads)}"
            )
        super().__init__(grid, unit_cells)
        self.lidar = grid.heads[0].grid

    def fire(self, scores: NDArray[Any], budget: int, floor: Floor | None, last: Cells) -> Cells:
        """The window that serves the demand."""
        width = budget // self.unit_cells
        places = self._reached(width, last)
        first = _best_place(demanded(scores), self.unit_of, places, width, self.units)
        fired = np.zeros(self.units, np.bool_)
        fired[self._window(first, width)] = True
        return np.flatnonzero(fired[self.unit_of])

    def best(self, worth: Floats, budget: int, last: Cells) -> Integers:
        """The units of the window that is worth the most of those that it can come to."""
        width = budget // self.unit_cells
        places = self._reached(width, last)
        # Twice around, so that a window over the seam is the difference of two sums, too.
        sums = np.concatenate([[0], np.cumsum([*worth, *worth])])
        units = self._window(int(places[np.argmax(sums[places + width] - sums[places])]), width)
        return units[ranked(worth[units])]

    def _window(self, first: int, width: int) -> Integers:
        """The units of the window that begins at the unit `first`, on a circle."""
        return (first + np.arange(width)) % self.units

    def _reached(self, width: int, last: Cells) -> Integers:
        """The first units of all places that a window can take after it fired the cells `last`, the
        nearest to where it stood first, of equals the lower one.
        """
        fired = np.zeros(self.units, np.bool_)
        fired[self.unit_of[last]] = True
        # It began where the neighbour before did not fire, over the seam, too. Over everything it
        # begins nowhere.
        begins = np.flatnonzero(fired & ~np.roll(fired, 1))
        return self._places(int(begins[0]) if len(begins) else self._start(width), width)

    @abstractmethod
    def _places(self, stood: int, width: int) -> Integers:
        """See `_reached`; the window `stood` at this first unit."""

    @abstractmethod
    def _start(self, width: int) -> int:
        """The first unit of the window before the first keyframe."""


@compiled()
def _best_place(order: Cells, unit_of: Integers, places: Integers, width: int, units: int) -> int:
    """The first of the `places` that holds the cells `order` as far as any does, each as long as it
    does not lose those before it. The units are counted on a circle; `places` is overwritten.
    """
    asked = np.zeros(units, np.bool_)
    count = len(places)
    for cell in order:
        unit = unit_of[cell]
        if count == 1:
            break
        if asked[unit]:
            continue
        asked[unit] = True

        # Counted first, for the places stay as they are where none of them holds the cell.
        holding = 0
        for place in places[:count]:
            holding += (unit - place) % units < width
        if 0 < holding < count:
            kept = 0
            for place in places[:count]:
                places[kept] = place
                kept += (unit - place) % units < width
            count = holding
    best: int = places[0]
    return best


class VerticalWindow(Window):
    """A sensor with a vertical field of view that is set anew for every frame, anywhere on the
    grid. Before the first keyframe it stands on the horizon.
    """

    name = "vertical-window"
    unit = "row"
    product = "long-range scanner with an adjustable vertical field of view"
    source = (
        "Luminar, Iris product sheet: vertical field of view dynamically adjustable (not opened)"
    )

    def __init__(self, grid: Grid):
        super().__init__(grid, grid.columns)

    @cached_property
    def unit_of(self) -> Integers:
        """(N,) the row of every cell."""
        return np.arange(self.grid.size) // self.grid.columns

    def _places(self, stood: int, width: int) -> Integers:
        # A window of rows has an upper and a lower end: no place goes around.
        places = np.arange(self.units - width + 1)
        return places[np.argsort(np.abs(places - stood), kind="stable")]

    def _start(self, width: int) -> int:
        horizon = int(np.argmin(np.abs(self.lidar.elevations_ahead)))
        return min(max(horizon - width // 2, 0), self.units - width)


_LAST_BITS = 1e-9
"""The most that rounding may take from a number of columns."""


class AzimuthWindow(Window):
    """A spinning sensor that fires within a window of azimuth. The window turns by at most
    `degrees` from keyframe to keyframe, and stands straight ahead before the first one.

    The sensor of the source restarts for another window, so that it has 0 degrees during a drive,
    and its lasers keep firing outside: it saves data, not shots. The usual 10 stand for a head that
    turns by 100 degrees a second; no product is known to. Raises InvalidInput for degrees outside 0
    to 180, and for a grid that does not go all round.
    """

    name = "azimuth-window"
    numbers = ("DEGREES",)
    usual = (10.0,)
    unit = "column"
    product = "spinning sensor with one window of azimuth"
    source = (
        "Ouster, firmware user manual, Azimuth Window: it masks what is sent, and the lasers go on "
        "firing"
    )

    def __init__(self, grid: Grid, degrees: float):
        check_number("degrees of firing azimuth-window", degrees, 0, 180)
        super().__init__(grid, grid.rows)
        if not self.lidar.goes_round:
            raise InvalidInput(
                "firing azimuth-window turns all round, and the grid has no more than "
                f"{np.rad2deg(self.lidar.field_of_view):g} degrees"
            )
        self.reach = int(np.deg2rad(degrees) / self.lidar.column_width + _LAST_BITS)
        """Columns by which it turns at most."""

    @cached_property
    def unit_of(self) -> Integers:
        """(N,) the column of every cell."""
        return np.arange(self.grid.size) % self.grid.columns

    def _places(self, stood: int, width: int) -> Integers:
        # Half a turn to either side holds every place once.
        turns = np.arange(-((self.units - 1) // 2), self.units // 2 + 1)
        turns = turns[np.argsort(np.abs(turns), kind="stable")]
        return (stood + turns[np.abs(turns) <= self.reach]) % self.units

    def _start(self, width: int) -> int:
        # Column 0 begins at the right end of the grid.
        ahead = round(-self.lidar.right / self.lidar.column_width)
        return (ahead - width // 2) % self.units
