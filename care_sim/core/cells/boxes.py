"""Azimuths and elevations that bound the hulls of boxes, and the cells of the dilated rectangles
around them (paper, Remark 2). Boxes (n, 7) are centre x, y, z, length, width, height, yaw.

The sensor frame is level, so that boxes in it stand upright, whatever the tilt of the grid. Where
the grid is tilted, the corners of the boxes are measured along its axes.
"""

import math
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.frames import turned

_AROUND = ((0.5, 0.5), (0.5, -0.5), (-0.5, -0.5), (-0.5, 0.5))
_CORNERS = np.array([[x, y, z] for z in (-0.5, 0.5) for x, y in _AROUND])

# A corner is joined to the one above it, and to the next and the one before in its own square of
# four: their numbers there differ by 1 or 3.
BOX_EDGES = np.array(
    [(a, b) for b in range(8) for a in range(b) if a + 4 == b or (a // 4 == b // 4 and (b - a) % 2)]
)
"""(12, 2) the edges of a box, as pairs of `box_corners`."""


def box_corners(boxes: Floats) -> Floats:
    """(n, 8, 3) corners of boxes (n, 7): four below, then the four above them."""
    return boxes[:, None, :3] + turned(_CORNERS * boxes[:, None, 3:6], boxes[:, 6:7])


def planar_ranges(boxes: Floats) -> Floats:
    """(n,) distances of the centres from the origin in the x, y plane."""
    ranges: Floats = np.hypot(boxes[:, 0], boxes[:, 1])
    return ranges


def half_extents(boxes: Floats) -> tuple[Floats, Floats]:
    """(n,) half of how far every box reaches along x, and (n,) along y."""
    length, width, yaw = boxes[:, 3], boxes[:, 4], boxes[:, 6]
    # The sides of a turned rectangle, each projected on the axis.
    cos, sin = np.abs(np.cos(yaw)), np.abs(np.sin(yaw))
    return (length * cos + width * sin) / 2, (length * sin + width * cos) / 2


Bounds = tuple[Floats, Floats, Mask]
"""Bounds of n boxes: azimuths (n, j), the centre's first; elevations (n, k); and whether the box
surrounds the axis (n,). Azimuths are counted about this axis, so such a box covers every column."""


def level_bounds(boxes: Floats) -> Bounds:
    """The bounds of boxes (n, 7) on a level grid."""
    # Angles are taken by NumPy here and not in the kernel: its arctangent differs from that of
    # compiled code in the last bits, and published cells were made with it.
    planar, upright, around = silhouettes(boxes)
    azimuths = np.arctan2(planar[..., 1], planar[..., 0])
    elevations = np.arctan2(upright[..., 0], upright[..., 1])
    return azimuths, elevations, around


def tilted_bounds(boxes: Floats, axes: Floats) -> Bounds:
    """The bounds of boxes (n, 7) on a grid whose forward, left and up are the rows of `axes` (3, 3)
    in the sensor frame.
    """
    # One product a box: that of all at once might round otherwise, by how many there are.
    centres = (boxes[:, None, :3] @ axes.T)[:, 0]
    return corner_bounds(centres, box_corners(boxes) @ axes.T)


def corner_bounds(centres: Floats, corners: Floats) -> Bounds:
    """Return the bounds of convex bodies with `corners` (n, 8, 3) and inner points `centres` (n,
    3), along the axes of the grid. Edges join the corners as in a box.
    """
    points = np.concatenate([centres[:, None], corners], axis=1)
    azimuths = np.arctan2(points[..., 1], points[..., 0])

    # Around the axis the corners leave no gap of half a turn between neighbours.
    turns = np.sort(azimuths[:, 1:], axis=1)
    gaps = np.diff(turns, axis=1, append=turns[:, :1] + 2 * np.pi)
    around = gaps.max(axis=1) < np.pi

    # A face has its highest and lowest elevation on its edges, for only at the poles is the
    # elevation of a direction extreme. A box around the axis reaches the pole above or below.
    extremes = np.concatenate([corners, _extreme_points(corners)], axis=1)
    elevations = np.arctan2(extremes[..., 2], np.hypot(extremes[..., 0], extremes[..., 1]))
    levels = corners[..., 2]
    above = np.where(around & (levels.max(axis=1) > 0), np.pi / 2, elevations[:, 0])
    below = np.where(around & (levels.min(axis=1) < 0), -np.pi / 2, elevations[:, 0])
    return azimuths, np.column_stack([elevations, above, below]), around


def _extreme_points(corners: Floats) -> Floats:
    """(n, 12, 3) the point of every edge of boxes with `corners` (n, 8, 3) at which its elevation
    is extreme, or the end that is nearest to it.
    """
    starts, ends = corners[:, BOX_EDGES[:, 0]], corners[:, BOX_EDGES[:, 1]]
    ways = ends - starts
    # At the share t of the way, z / hypot(x, y) is extreme where its derivative is 0. The terms
    # with t^2 cancel out, so that there is one such t.
    z, rise = starts[..., 2], ways[..., 2]
    along = (starts * ways)[..., :2].sum(axis=-1)
    beyond = rise * along - z * (ways[..., :2] ** 2).sum(axis=-1)
    behind = z * along - rise * (starts[..., :2] ** 2).sum(axis=-1)
    shares = np.divide(behind, beyond, out=np.zeros_like(z), where=beyond != 0)
    points: Floats = starts + np.clip(shares, 0.0, 1.0)[..., None] * ways
    return points


@compiled()
def silhouettes(boxes: Floats) -> tuple[Floats, Floats, Mask]:
    """The bounds of the hulls of boxes (n, 7), seen from the origin, and which boxes surround it.

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


class GridSpacing(NamedTuple):
    """Numbers of a grid from which the cell of a direction follows; angles are in radians. The grid
    has `columns` of `column_width` and `rows` of `row_height`. Row 0 has the elevation `top`, and
    column 0 begins at the azimuth `right`. `turn` is the number of columns that a whole turn would
    have. `elevations` (rows,) lists rows that are not equally spaced, else it is (0,).
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
def rectangle_cells(
    azimuths: Floats,
    elevations: Floats,
    azimuth_margins: Integers,
    elevation_margin: int,
    grid: GridSpacing,
) -> tuple[Integers, Integers]:
    """The cells of n rectangles, each ascending, and their sizes, as in
    `care_sim.core.cells.sets.CellSets`.

    A rectangle holds the `azimuths` (n, j) and the `elevations` (n, k) of its row. It is dilated by
    `azimuth_margins` (n,) columns and `elevation_margin` rows. Azimuths are within half a turn of
    the first.
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
        # Columns beyond a turn continue at column 0.
        for column in range(min(stop - grid.turn, columns)):
            cells[place] = row * columns + column
            place += 1
        for column in range(first, min(stop, columns)):
            cells[place] = row * columns + column
            place += 1
    return place
