"""The angular grid of firing cells, and the cells that boxes and ray bundles cover.

Frame: sensor frame, x forward, y left, z up; metres and radians. A cell's index is `row * columns +
column`; row 0 is the highest elevation and column c covers the azimuths [right + c * width, right +
(c + 1) * width). All round the car, which is the default, `right` is -pi. Directions, boxes and
rays are in the sensor frame. Azimuths and elevations are about the grid's own axes, which are those
of the sensor frame unless the LiDAR is tilted to the car.
"""

import math
from dataclasses import fields, replace
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from care_sim.base.compiled import compiled
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers
from care_sim.core.cells.boxes import (
    GridSpacing,
    corner_bounds,
    level_bounds,
    nearest_rows,
    rectangle_cells,
    tilted_bounds,
)
from care_sim.core.cells.rays import GridRays
from care_sim.core.cells.sets import CellSets
from care_sim.core.defaults import AZIMUTH_MARGIN, ELEVATION_MARGIN
from care_sim.core.frames import Frame

Cells = NDArray[np.int64]
Place = tuple[float, float, float]
"""x, y and z in metres."""

AT_LIDAR_M = 1.5
"""A camera within this distance of a LiDAR counts as being at the LiDAR. The paper's wedges assume
this silently. The six cameras of nuScenes are 0.5 to 1.0 m from LIDAR_TOP."""
LEAST_DEPTH_M = 5.0
"""The wedges of a camera farther from a LiDAR begin at this depth along its optical axis, so that
beside the middle of a picture they begin farther away. A car needs 4.3 m to stop from 30 km/h at 8
m/s^2. An object first seen nearer is therefore too late for any LiDAR. Every metre less would widen
the wedges of all that is farther."""
_ORIGIN = np.zeros(3)
_ORIGIN.flags.writeable = False


class Head(NamedTuple):
    """One LiDAR of a set-up: its own `grid`, the `place` (x, y, z) where it stands in the sensor
    frame, in metres, and its `first` cell among those of all. It looks along the axes of the sensor
    frame, from its own place.
    """

    grid: "AngularGrid"
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


class HeadCells:
    """The properties that firing cells needs of the grid of one LiDAR or of several."""

    @cached_property
    def heads(self) -> tuple[Head, ...]:
        """Its LiDARs one by one."""
        raise NotImplementedError

    @cached_property
    def directions(self) -> Floats:
        """(N, 3) unit vectors of the rays, each from its own LiDAR."""
        raise NotImplementedError

    def __getstate__(self) -> dict[str, Any]:
        # Tables are megabytes for a large grid: a copy, in a worker for example, makes its own.
        return {one.name: getattr(self, one.name) for one in fields(self)}  # type: ignore[arg-type]

    def __deepcopy__(self, _copied: dict[int, Any]) -> Self:
        # Frozen: within a process a copy may share it, and its tables.
        return self

    @cached_property
    def head_rows(self) -> Integers:
        """(heads, 3) the first row and the last of each, and how many of its columns a whole turn
        would have.
        """
        return np.array([(*head.rows, head.grid.turn) for head in self.heads])

    def cells_at(self, points: Floats) -> Cells:
        """(n, heads) the cell of each LiDAR in which a point (n, 3) lies, -1 beyond its rows or its
        field of view.
        """
        found = [(head.grid.cells_of(head.points(points)), head.first) for head in self.heads]
        return np.stack([np.where(own >= 0, own + first, -1) for own, first in found], axis=1)

    def lidars_of(self, cells: Cells) -> Integers:
        """(n,) the number, from 0, of the LiDAR of each of `cells` (n,)."""
        numbers: Integers = self._lidars[cells]
        return numbers

    @cached_property
    def _lidars(self) -> Integers:
        # Looked up in three quarters of the time of a search (3,195 cells of three LiDARs).
        return np.repeat(np.arange(len(self.heads)), [head.grid.size for head in self.heads])

    def origins_of(self, cells: Cells) -> Floats:
        """(n, 3) where the rays of `cells` (n,) begin in the sensor frame; (3,) of one LiDAR, whose
        rays all begin at its origin.
        """
        if len(self.heads) == 1:
            return _ORIGIN
        return np.array([head.place for head in self.heads])[self.lidars_of(cells)]

    def points(self, cells: Cells, ranges: Floats) -> Floats:
        """(n, 3) where rays of `cells` (n,) end after `ranges` (n,) metres, in the sensor frame."""
        return self.origins_of(cells) + self.directions[cells] * ranges[:, None]

    def ranges_to(self, cells: Cells, points: Floats) -> Floats:
        """(n,) how far points (n, 3) are from the LiDAR whose rays, of `cells` (n,), met them."""
        ranges: Floats = _lengths(points - self.origins_of(cells))
        return ranges

    def stretched(self, cells: Cells, points: Floats, factors: Floats) -> Floats:
        """(n, 3) points (n, 3) that rays of `cells` (n,) met, at ranges `factors` (n,) times as
        long.
        """
        origins = self.origins_of(cells)
        stretched: Floats = origins + (points - origins) * factors[:, None]
        return stretched

    def reach_of(self, cells: Cells) -> float | Floats:
        """The reach of the rays of `cells` (n,), metres: one number of one LiDAR, else one each."""
        reaches = np.array([head.grid.range_m for head in self.heads], float)
        return self.heads[0].grid.range_m if len(reaches) == 1 else reaches[self.lidars_of(cells)]


class AngularGrid(GridRays, HeadCells):
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
    def heads(self) -> tuple[Head, ...]:
        """The grid as that of the one LiDAR of a set-up; see `Head`."""
        return (Head(self, (0.0, 0.0, 0.0), 0),)

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
        (n, 3) is where the rays of each start, if not at the LiDAR. Starts within `AT_LIDAR_M` of
        it count as rays of its own. Elsewhere, the four rays behind the middle are the corners of
        an image box, one unit of depth long. Their rectangle holds all that they enclose, seen from
        the LiDAR, from `LEAST_DEPTH_M` to the LiDAR's reach.
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
        """The cells of every rectangle; see `care_sim.core.cells.boxes.rectangle_cells`."""
        return CellSets(
            *rectangle_cells(azimuths, elevations, margins, elevation_margin, self.spacing)
        )


@compiled()
def _lengths(vectors: Floats) -> Floats:
    """Return (n,) the lengths of `vectors` (n, 3), to the last bit those of `numpy.linalg.norm`."""
    lengths = np.empty(len(vectors))
    for n in range(len(vectors)):
        x, y, z = vectors[n]
        lengths[n] = math.sqrt(x * x + y * y + z * z)
    return lengths
