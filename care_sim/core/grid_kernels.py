"""The cells of dilated angular rectangles, compiled: every hull and every wedge is one (paper,
Remark 2).
"""

import math
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers, Mask


class GridSpacing(NamedTuple):
    """What of a grid tells the cell of a direction: its numbers of `columns` and `rows`, the
    `column_width` and `row_height` in radians, the elevation `top` of row 0, the azimuth `right` at
    which column 0 begins, how many columns a whole `turn` would have, and the `elevations` (rows,)
    of rows that are not equally spaced, else (0,).
    """

    columns: int
    rows: int
    column_width: float
    top: float
    row_height: float
    right: float
    turn: int
    elevations: Floats


@compiled()
def row_at(elevation: float, grid: GridSpacing) -> float:
    """Where an elevation lies among the rows: k at row k, in proportion between two rows, and on in
    the steps of the outermost two beyond them.
    """
    listed = grid.elevations
    if len(listed) == 0:
        return (grid.top - elevation) / grid.row_height
    # Bisection for the first row from 1 on that is not above it; the last row bounds the search.
    low, high = 1, grid.rows - 1
    while low < high:
        middle = (low + high) // 2
        if listed[middle] > elevation:
            low = middle + 1
        else:
            high = middle
    above, below = listed[low - 1], listed[low]
    place: float = low - 1 + (above - elevation) / (above - below)
    return place


@compiled()
def nearest_rows(elevations: Floats, grid: GridSpacing) -> Integers:
    """(n,) the row whose ray is nearest to every elevation (n,); on the grid or beyond it."""
    rows = np.empty(len(elevations), np.int64)
    for n, elevation in enumerate(elevations):
        rows[n] = math.floor(row_at(elevation, grid) + 0.5)
    return rows


@compiled()
def silhouettes(boxes: Floats) -> tuple[Floats, Floats, Mask]:
    """What of boxes (n, 7) bounds their hulls, seen from the origin, and which of them surround it.

    Returns x and y (n, 5, 2) of the centre and the four corners. Then (n, 2, 2) the heights of
    bottom and top, each with the distance in the x, y plane at which it appears lowest or highest.
    Then (n,) whether a box stands around the origin.
    """
    planar = np.empty((len(boxes), 5, 2))
    upright = np.empty((len(boxes), 2, 2))
    around = np.empty(len(boxes), np.bool_)

    for n, (x, y, z, length, width, height, yaw) in enumerate(boxes):
        # How far the origin lies beyond the sides, in the axes of the box. Negative means between
        # two sides and counts as 0. So the distance to the nearest point of the footprint follows,
        # and it is 0 for an origin inside.
        cos, sin = math.cos(yaw), math.sin(yaw)
        beyond = abs(cos * x + sin * y) - length / 2, abs(sin * x - cos * y) - width / 2
        near = math.hypot(max(beyond[0], 0.0), max(beyond[1], 0.0))

        # Seen from outside, a rectangle spans the directions between two of its corners. Its
        # farthest point is a corner, too, since distance is a convex function. The centre goes
        # first, as the direction that all are compared with.
        far = 0.0
        planar[n, 0] = x, y
        for k, (front, left) in enumerate(((0.5, 0.5), (0.5, -0.5), (-0.5, -0.5), (-0.5, 0.5))):
            along, across = front * length, left * width
            corner = x + (cos * along - sin * across), y + (sin * along + cos * across)
            planar[n, k + 1] = corner
            far = max(far, math.hypot(corner[0], corner[1]))

        # A bottom below the horizon appears lowest where it is nearest, one above it where it is
        # farthest; a top the other way round.
        bottom, top = z - height / 2, z + height / 2
        upright[n, 0] = bottom, near if bottom < 0 else far
        upright[n, 1] = top, near if top > 0 else far
        around[n] = near <= 0.0
    return planar, upright, around


@compiled()
def rectangle_cells(
    azimuths: Floats,
    elevations: Floats,
    azimuth_margins: Integers,
    elevation_margin: int,
    grid: GridSpacing,
) -> tuple[Integers, Integers]:
    """The cells of n rectangles, each ascending, and their sizes, as in
    `care_sim.core.cell_sets.CellSets`.

    A rectangle holds the `azimuths` (n, j) of its row, which lie within half a turn of the first,
    and the `elevations` (n, k), dilated by `azimuth_margins` (n,) columns and `elevation_margin`
    rows.
    """
    # Edges first, so that the table of cells is made once and of the right size. A rectangle that
    # misses the grid has no rows, and its cells end where they begin.
    edges = np.empty((len(azimuths), 4), np.int64)
    sizes = np.empty(len(azimuths), np.int64)
    for n in range(len(azimuths)):
        first, stop = edges[n, 0], edges[n, 1] = _columns(azimuths[n], azimuth_margins[n], grid)
        upper, lower = edges[n, 2], edges[n, 3] = _rows(elevations[n], elevation_margin, grid)
        sizes[n] = _width(first, stop, grid) * (lower - upper)

    # Each rectangle is written where the one before it ended.
    cells = np.empty(sizes.sum(), np.int64)
    place = 0
    for edge in edges:
        place = _lay(cells, place, edge, grid)
    return cells, sizes


@compiled()
def _columns(azimuths: Floats, margin: int, grid: GridSpacing) -> tuple[int, int]:
    """First column, within a turn, and the one after the last, up to a turn beyond it."""
    # Offsets from the middle are within half a turn, so that the seam at -pi does not matter.
    middle = azimuths[0]
    right, left = math.inf, -math.inf
    for azimuth in azimuths:
        offset = (azimuth - middle + math.pi) % (2 * math.pi) - math.pi
        right, left = min(right, offset), max(left, offset)

    # Column c begins at grid.right + c * width and reaches to the next, so both ends round down.
    # With its margin a rectangle may be wider than a turn; no column counts twice.
    first = math.floor((middle + right - grid.right) / grid.column_width) - margin
    last = math.floor((middle + left - grid.right) / grid.column_width) + margin
    start = first % grid.turn
    return start, start + max(0, min(last - first + 1, grid.turn))


@compiled()
def _width(first: int, stop: int, grid: GridSpacing) -> int:
    """How many of these columns of a turn the grid has."""
    before, beyond = min(stop, grid.columns) - first, min(stop - grid.turn, grid.columns)
    return max(0, before) + max(0, beyond)


@compiled()
def _rows(elevations: Floats, margin: int, grid: GridSpacing) -> tuple[int, int]:
    """First row and the one after the last; equal where the rectangle misses the grid."""
    # A row reaches half a step above and below its ray, hence the 0.5.
    upper = math.floor(row_at(elevations.max(), grid) + 0.5) - margin
    lower = math.floor(row_at(elevations.min(), grid) + 0.5) + margin
    first = min(max(upper, 0), grid.rows)
    return first, max(first, min(lower + 1, grid.rows))


@compiled()
def _lay(cells: Integers, place: int, edges: Integers, grid: GridSpacing) -> int:
    """Write the cells of a rectangle from `place` on; the place after them.

    In every row those beyond the seam come first: their columns, and so their indices, are lower.
    """
    first, stop, upper, lower = edges
    columns = grid.columns
    for row in range(upper, lower):
        # What reaches beyond a turn goes on at column 0.
        for column in range(min(stop - grid.turn, columns)):
            cells[place] = row * columns + column
            place += 1
        for column in range(first, min(stop, columns)):
            cells[place] = row * columns + column
            place += 1
    return place


@compiled(brief=True)
def copy_rows(rows: Floats, into: Floats) -> None:
    """Copy `rows` (n, k) to the first n rows of `into` (m, k).

    An assignment of slices does the same, but Numba compiles the text of its error along, which
    takes seconds.
    """
    for n in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            into[n, k] = rows[n, k]
