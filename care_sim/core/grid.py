"""The angular grid of firing cells, and the cells that boxes and ray bundles cover.

Frame: sensor frame, x forward, y left, z up; metres and radians. A cell's index is
`row * columns + column`; row 0 is the highest elevation and column c covers the azimuths
[right + c * width, right + (c + 1) * width). All round the car, which is the default, `right` is
-pi. Azimuths and elevations are about the grid's own axes, which the sensor frame has, too, unless
the LiDAR is tilted to the car; directions, boxes and rays are told in the sensor frame.
"""

import math
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from care_sim.base.compiled import compiled
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers
from care_sim.core.cells.boxes import corner_bounds, level_bounds, tilted_bounds
from care_sim.core.cells.rays import GridRays
from care_sim.core.cells.sets import CellSets
from care_sim.core.defaults import AZIMUTH_MARGIN, ELEVATION_MARGIN
from care_sim.core.frames import Frame


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
def rectangle_cells(
    azimuths: Floats,
    elevations: Floats,
    azimuth_margins: Integers,
    elevation_margin: int,
    grid: GridSpacing,
) -> tuple[Integers, Integers]:
    """The cells of n rectangles, each ascending, and their sizes, as in
    `care_sim.core.cells.sets.CellSets`.

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


Cells = NDArray[np.int64]
Place = tuple[float, float, float]
"""x, y and z in metres."""

AT_LIDAR_M = 1.5
"""A camera within this of a LiDAR is taken to stand at it, as the paper's wedges do without a word
on it: the six of nuScenes are 0.5 to 1.0 m from LIDAR_TOP."""
LEAST_DEPTH_M = 5.0
"""What a camera farther from a LiDAR shows is sought from this depth on. It is along the optical
axis of that camera, so that beside the middle of a picture it begins farther away. A car needs
4.3 m to stop from 30 km/h at 8 m/s^2: what is first seen nearer comes too late for any LiDAR, and
every metre less widens the wedges of all that is farther."""
_ORIGIN = np.zeros(3)
_ORIGIN.flags.writeable = False


class AngularGrid(GridRays):
    """`columns` x `rows` firing cells of a LiDAR.

    The defaults are the grid of the paper (Remark 1): 512 columns, and the 32 rings of the
    nuScenes sensor from +10.67 to -30.67 degrees in equal steps. `range_m` is the reach of a ray.

    The columns share a `field_of_view` (radians, horizontal) about the azimuth `heading`; their
    width must divide a whole turn. Rows that are not equally spaced are `listed`: their elevations,
    from the top, of which the first and the last are `top` and `bottom` (`of_elevations` makes such
    a grid). A LiDAR that is tilted to the car has a `pitch`, which raises its heading, and a
    `roll`, which lowers its right (radians). Raises InvalidInput for a value out of its bounds.
    """

    @cached_property
    def heads(self) -> "tuple[Head, ...]":
        """The grid as that of the one LiDAR of a set-up; see `Head`."""
        return (Head(self, (0.0, 0.0, 0.0), 0),)

    @cached_property
    def head_rows(self) -> Integers:
        """(1, 3) the first row and the last, and how many columns a whole turn would have."""
        return np.array([(0, self.rows - 1, self.turn)])

    @cached_property
    def spacing(self) -> GridSpacing:
        """The spacing of the grid, in the form that compiled code takes."""
        top = float(self.top)
        height = float(self.row_height)
        size = self.columns, self.rows
        listed = np.array(self.listed, float)
        return GridSpacing(*size, self.column_width, top, height, self.right, self.turn, listed)

    def cells_of(self, directions: ArrayLike) -> Cells:
        """The cell each direction (n, 3) falls in; -1 beyond the rows or the field of view.

        Raises InvalidInput for a direction that holds NaN.
        """
        x, y, z = self._about_own_axes(np.asarray(directions, dtype=float).reshape(-1, 3)).T
        azimuth = np.arctan2(y, x)
        elevation = np.arctan2(z, np.hypot(x, y))
        if np.isnan(azimuth).any() or np.isnan(elevation).any():
            raise InvalidInput("directions must be numbers, none of them NaN")
        # The azimuth pi is -pi: it would fall in the column after the last, which is column 0.
        column = np.floor((azimuth - self.right) / self.column_width).astype(np.int64) % self.turn
        row = nearest_rows(elevation, self.spacing)
        inside = (row >= 0) & (row < self.rows) & (column < self.columns)
        return np.where(inside, row * self.columns + column, -1)

    def cells_at(self, points: Floats) -> Cells:
        """(n, 1) the cell in which each point (n, 3) lies, -1 beyond the rows or the field of
        view.
        """
        return self.cells_of(points)[:, None]

    def lidars_of(self, cells: Cells) -> Integers:
        """(n,) the number of the LiDAR of each of `cells` (n,): that of the only one, 0."""
        return np.zeros(len(cells), np.int64)

    def origins_of(self, cells: Cells) -> Floats:
        """(3,) where the rays of `cells` (n,) begin in the sensor frame: all at its origin."""
        return _ORIGIN

    def points(self, cells: Cells, ranges: Floats) -> Floats:
        """(n, 3) where rays of `cells` (n,) end after `ranges` (n,) metres, in the sensor frame."""
        points: Floats = self.directions[cells] * ranges[:, None]
        return points

    def ranges_to(self, cells: Cells, points: Floats) -> Floats:
        """(n,) how far points (n, 3) are from the LiDAR whose rays, of `cells` (n,), met them."""
        ranges: Floats = np.linalg.norm(points, axis=1)
        return ranges

    def stretched(self, cells: Cells, points: Floats, factors: Floats) -> Floats:
        """(n, 3) points (n, 3) that rays of `cells` (n,) met, at ranges `factors` (n,) times as
        long.
        """
        stretched: Floats = points * factors[:, None]
        return stretched

    def reach_of(self, cells: Cells) -> float | Floats:
        """The reach of the rays of `cells` (n,), metres: one number, or one each."""
        return self.range_m

    def hulls(
        self,
        boxes: ArrayLike,
        azimuth_margin: int | Integers = AZIMUTH_MARGIN,
        elevation_margin: int = ELEVATION_MARGIN,
    ) -> CellSets:
        """The dilated angular rectangle of every box, as ascending cells.

        `boxes` is (n, 7): centre x, y, z, length, width, height, yaw. `azimuth_margin` is one
        number, or one per box. A box that stands around the axis of the grid, which is upright
        through the sensor unless it is tilted, covers every column.
        """
        boxes = np.ascontiguousarray(boxes, dtype=float).reshape(-1, 7)
        if not len(boxes):
            return CellSets.of([])
        azimuths, elevations, around = (
            tilted_bounds(boxes, self.tilt.as_matrix().T) if self.is_tilted else level_bounds(boxes)
        )
        margins = np.where(around, self.turn, azimuth_margin)
        return self._rectangles(azimuths, elevations, margins, elevation_margin)

    def wedges(
        self,
        bundles: ArrayLike,
        azimuth_margin: int = AZIMUTH_MARGIN,
        elevation_margin: int = ELEVATION_MARGIN,
        starts: Floats | None = None,
    ) -> CellSets:
        """The dilated angular rectangle of every bundle of rays (n, k, 3), as ascending cells.

        The first ray of a bundle is its middle; the others lie within half a turn of it. `starts`
        (n, 3) is where the rays of each start, if not at the LiDAR. Those within `AT_LIDAR_M` of it
        count as rays of its own. Of the others the four behind the middle are the corners of an
        image box, one unit of depth long: their rectangle holds all that they enclose, seen from
        the LiDAR, from `LEAST_DEPTH_M` on and as far as it reaches.
        """
        bundles = np.asarray(bundles, dtype=float)
        if not len(bundles):
            return CellSets.of([])
        if starts is not None and (apart := np.linalg.norm(starts, axis=1) > AT_LIDAR_M).any():
            dilation = azimuth_margin, elevation_margin
            near = self.wedges(bundles[~apart], *dilation)
            far = self._wedges_from_afar(bundles[apart], starts[apart], *dilation)
            # Back in the order of the bundles.
            return CellSets.joined([near, far]).take(np.argsort(np.argsort(apart, kind="stable")))
        bundles = self._about_own_axes(bundles)
        x, y, z = bundles[..., 0], bundles[..., 1], bundles[..., 2]
        azimuths = np.arctan2(y, x)
        elevations = np.arctan2(z, np.hypot(x, y))
        margins = np.full(len(bundles), azimuth_margin)
        return self._rectangles(azimuths, elevations, margins, elevation_margin)

    def _wedges_from_afar(
        self, bundles: Floats, starts: Floats, azimuth_margin: int, elevation_margin: int
    ) -> CellSets:
        """Wedges of bundles whose rays start elsewhere; see `wedges`."""
        # A ray is at least as long as its depth, so that nothing in reach lies deeper than this.
        deepest = LEAST_DEPTH_M + self.range_m + np.linalg.norm(starts, axis=1)
        depths = np.stack([np.full(len(starts), LEAST_DEPTH_M), deepest], axis=1)
        # Cut at two depths, the rays of an image box are the edges of a frustum. In this order they
        # go round it.
        rays = bundles[:, None, [1, 2, 4, 3]] * depths[:, :, None, None]
        corners = self._about_own_axes(starts[:, None, None] + rays).reshape(-1, 8, 3)
        azimuths, elevations, around = corner_bounds(corners.mean(axis=1), corners)
        margins = np.where(around, self.turn, azimuth_margin)
        return self._rectangles(azimuths, elevations, margins, elevation_margin)

    def _about_own_axes(self, vectors: Floats) -> Floats:
        """Vectors (..., 3) of the sensor frame along the grid's own axes."""
        return vectors @ self.tilt.as_matrix() if self.is_tilted else vectors

    def _rectangles(
        self, azimuths: Floats, elevations: Floats, margins: Integers, elevation_margin: int
    ) -> CellSets:
        """The cells of every rectangle; see `care_sim.core.grid.rectangle_cells`."""
        return CellSets(
            *rectangle_cells(azimuths, elevations, margins, elevation_margin, self.spacing)
        )


class Head(NamedTuple):
    """One LiDAR of a set-up: its own `grid`, the `place` (x, y, z) where it stands in the sensor
    frame, in metres, and its `first` cell among those of all. It looks along the axes of the sensor
    frame, from its own place.
    """

    grid: AngularGrid
    place: Place
    first: int

    @property
    def cells(self) -> slice:
        """Its cells among those of all."""
        return slice(self.first, self.first + self.grid.size)

    @property
    def rows(self) -> tuple[int, int]:
        """Its first row and its last among those of all."""
        first = self.first // self.grid.columns
        return first, first + self.grid.rows - 1

    def frame(self, sensor: Frame) -> Frame:
        """Its frame, where that of the set-up is `sensor`."""
        if not any(self.place):
            return sensor
        x, y, z = (sensor.origin + sensor.vectors_to_world(np.array(self.place))).tolist()
        return replace(sensor, x=x, y=y, z=z)

    def boxes(self, boxes: Floats) -> Floats:
        """Boxes (n, 7) of the sensor frame, seen from its place."""
        return boxes - np.array([*self.place, 0.0, 0.0, 0.0, 0.0]) if any(self.place) else boxes

    def points(self, points: Floats) -> Floats:
        """Points (n, 3) of the sensor frame, seen from its place."""
        return points - np.array(self.place) if any(self.place) else points
