"""The angular grid of firing cells, and the cells that boxes and ray bundles cover.

Frame: sensor frame, x forward, y left, z up; metres and radians. A cell's index is
`row * columns + column`; row 0 is the highest elevation and column c covers the azimuths
[right + c * width, right + (c + 1) * width). All round the car, which is the default, `right` is
-pi. Azimuths and elevations are about the grid's own axes, which the sensor frame has, too, unless
the LiDAR is tilted to the car; directions, boxes and rays are told in the sensor frame.
"""

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers
from care_sim.core.box_bounds import level_bounds, tilted_bounds
from care_sim.core.cell_sets import CellSets
from care_sim.core.grid_kernels import GridSpacing, nearest_rows, rectangle_cells
from care_sim.core.grid_rays import GridRays

Cells = NDArray[np.int64]

AZIMUTH_MARGIN = 2
"""Dilation of hulls and wedges, in columns (paper, Remark 2)."""
ELEVATION_MARGIN = 1
"""Dilation of hulls and wedges, in rows (paper, Remark 2)."""


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
    ) -> CellSets:
        """The dilated angular rectangle of every bundle of rays (n, k, 3), as ascending cells.

        The first ray of a bundle is its middle; the others lie within half a turn of it.
        """
        bundles = np.asarray(bundles, dtype=float)
        if not len(bundles):
            return CellSets.of([])
        bundles = self._about_own_axes(bundles)
        x, y, z = bundles[..., 0], bundles[..., 1], bundles[..., 2]
        azimuths = np.arctan2(y, x)
        elevations = np.arctan2(z, np.hypot(x, y))
        margins = np.full(len(bundles), azimuth_margin)
        return self._rectangles(azimuths, elevations, margins, elevation_margin)

    def _about_own_axes(self, vectors: Floats) -> Floats:
        """Vectors (..., 3) of the sensor frame along the grid's own axes."""
        return vectors @ self.tilt.as_matrix() if self.is_tilted else vectors

    def _rectangles(
        self, azimuths: Floats, elevations: Floats, margins: Integers, elevation_margin: int
    ) -> CellSets:
        """The cells of every rectangle; see `care_sim.core.grid_kernels.rectangle_cells`."""
        return CellSets(
            *rectangle_cells(azimuths, elevations, margins, elevation_margin, self.spacing)
        )
