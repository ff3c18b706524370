"""Places where new objects can appear: along open lines of sight, at the edges of occluders, and in
the sector ahead, where objects enter the scored range.
"""

import math

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Mask
from care_sim.core.belief import Belief
from care_sim.core.cells.boxes import GridSpacing
from care_sim.core.cells.stack import Grid
from care_sim.core.grid import Cells
from care_sim.core.rig import Rig

AHEAD_RAD = math.atan(13 / 50)
"""Half of the sector. At the scored range, 50 m, it covers a street of 26 m from house to house,
with two lanes, parked cars and pavements.
"""


def columns_ahead(grid: Grid, half_rad: float = AHEAD_RAD) -> Cells:
    """Return (n,) the columns whose middle is within `half_rad` of straight ahead, the nearest
    first; none on a grid with wider columns. Columns of the second of several LiDARs are numbered
    after those of the first.
    """
    off_ahead = np.abs(np.concatenate([head.grid.azimuths for head in grid.heads]))
    nearest_first = np.argsort(off_ahead, kind="stable")
    columns: Cells = nearest_first[off_ahead[nearest_first] <= half_rad]
    return columns


OPEN_M = 25.0
"""A line of sight is open if nothing is nearer than this, half the scored range."""
EDGE_M = 5.0
"""Neighbouring columns have an edge between them if their ranges differ by more: about the length
of a car, which leaves room behind it.
"""
EDGE_COLUMNS = 4
"""Watched columns on either side of an edge: on the paper's grid 2.8 degrees, or 1.5 m at a range
of 30 m. A walker covers that in a second, a car in a tenth of one.
"""
_NEAREST_M = 1.0
"""Least remembered range: the car itself is nearer."""
_LAST_BITS = 1e-9
"""Allowance for rounding of a number of columns."""


class SightLines:
    """A memory of the last range along one of the `cells` (A,) of every column, moved with the car.
    The columns of several LiDARs follow each other, each with its own memory.

    Objects drive into the range at the end of an open line of sight; hidden objects appear at an
    edge. A line without memory counts as open. `ranges` (A,) are metres at the next keyframe, the
    grid's reach without memory.

    The memory moves by whole columns, so it misses slow turns until a column is fired again. A lost
    return looks like an open line. On a dead row (`lidar_dead_rows`) every line stays open, and
    watching it wastes cells.
    """

    ranges: Floats

    def __init__(self, rig: Rig, cells: Cells):
        self._lines = cells
        self._keyframe_s = rig.keyframe_s
        columns = rig.grid.columns
        self._heads = [
            (slice(columns * n, columns * (n + 1)), head.grid.spacing, head.grid.azimuths)
            for n, head in enumerate(rig.grid.heads)
        ]
        self._sector = columns_ahead(rig.grid)
        # For a line without a return a scan holds the reach in float32, which can be less than the
        # reach.
        self._reach = float(np.float32(rig.grid.range_m))
        # On a grid of shorter reach, a line without a return is also open.
        self._open_m = min(OPEN_M, self._reach / 2)
        self.ranges = np.full(len(cells), self._reach)
        self._watched = self._watched_lines()

    def update(self, belief: Belief) -> None:
        """Update the memory with the last scan, and move it by the car's motion since."""
        seen = belief.ranges.ravel()[self._lines]
        np.copyto(self.ranges, seen, where=seen > 0)
        driven = belief.ego.speed * self._keyframe_s
        turned = belief.ego.yaw_rate * self._keyframe_s
        way = driven, turned
        for own, spacing, azimuths in self._heads:
            self.ranges[own] = _moved(self.ranges[own], azimuths, way, self._reach, spacing)
        self._watched = self._watched_lines()

    def ahead(self) -> Cells:
        """Return the watched cells in the sector ahead, the nearest to straight ahead first."""
        return self._cells(self._sector[self._watched[self._sector]])

    def cells(self) -> Cells:
        """Return all watched cells, by ascending column."""
        return self._cells(np.flatnonzero(self._watched))

    def _watched_lines(self) -> Mask:
        """Return (A,) which lines are open, or near an edge."""
        return np.concatenate(
            [_open_or_edge(self.ranges[own], self._open_m, grid) for own, grid, _ in self._heads]
        )

    def _cells(self, columns: Cells) -> Cells:
        cells: Cells = self._lines[columns]
        return cells


@compiled()
def _moved(
    ranges: Floats, azimuths: Floats, way: tuple[float, float], reach: float, grid: GridSpacing
) -> Floats:
    """Return the `ranges` (A,) of standing objects after the car's `way` (metres ahead, radians to
    the left); `reach` where none is left.
    """
    driven, turned = way
    columns = len(ranges)
    moved = np.full(columns, reach)
    for column in range(columns):
        before = ranges[column]
        if before < reach:
            x = before * math.cos(azimuths[column]) - driven
            y = before * math.sin(azimuths[column])
            now = max(math.hypot(x, y), _NEAREST_M)
            middle = math.floor((math.atan2(y, x) - turned - grid.right) / grid.column_width)

            # A nearer surface covers more than its one column. The width is rounded up, so that no
            # gap opens in a wall: an approaching surface grows by a column on either side. The
            # nearer of two surfaces behind each other counts.
            half = math.ceil((before / now - 1) / 2 - _LAST_BITS)
            for covered in range(middle - half, middle + half + 1):
                place = covered % grid.turn
                if place < columns:
                    moved[place] = min(moved[place], now)
    return moved


@compiled()
def _open_or_edge(ranges: Floats, open_m: float, grid: GridSpacing) -> Mask:
    """Return (A,) which columns are open, or within `EDGE_COLUMNS` of an edge."""
    columns = len(ranges)
    watched = ranges >= open_m
    for column in range(columns):
        # The edge lies between this column and the next.
        after = (column + 1) % grid.turn
        if after < columns and abs(ranges[column] - ranges[after]) > EDGE_M:
            for near in range(column - EDGE_COLUMNS + 1, column + EDGE_COLUMNS + 1):
                if near % grid.turn < columns:
                    watched[near % grid.turn] = True
    return watched
