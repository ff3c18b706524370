"""The angular grid of firing cells, and the cells that boxes and ray bundles cover.

Frame: sensor frame, x forward, y left, z up; metres and radians. A cell's index is
`row * columns + column`; row 0 is the highest elevation and column c covers the azimuths
[-pi + c * width, -pi + (c + 1) * width).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from care_sim.base.bounds import bounded, check_fields
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers
from care_sim.core.cell_sets import CellSets
from care_sim.core.grid_kernels import GridSpacing, rectangle_cells, silhouettes

Cells = NDArray[np.int64]

AZIMUTH_MARGIN = 2
"""Dilation of hulls and wedges, in columns (paper, Remark 2)."""
ELEVATION_MARGIN = 1
"""Dilation of hulls and wedges, in rows (paper, Remark 2)."""
MOST_COLUMNS, MOST_ROWS = 2**14, 2**10
"""Bounds of a grid: a thousand times the cells of the paper's."""


@dataclass(frozen=True)
class AngularGrid:
    """`columns` x `rows` firing cells of a rotating LiDAR.

    The defaults are the grid of the paper (Remark 1): 512 columns, and the 32 rings of the
    nuScenes sensor from +10.67 to -30.67 degrees in equal steps. `range_m` is the reach of a ray.
    """

    columns: int = bounded(512, 1, MOST_COLUMNS)
    rows: int = bounded(32, 2, MOST_ROWS)
    top: float = bounded(float(np.deg2rad(10.67)), -np.pi / 2, np.pi / 2)
    bottom: float = bounded(float(np.deg2rad(-30.67)), -np.pi / 2, np.pi / 2)
    range_m: float = bounded(50.0, 1, 1_000_000)

    def __post_init__(self) -> None:
        check_fields(self, " of the grid")
        if self.bottom >= self.top:
            raise InvalidInput(
                f"bottom of the grid must lie below its top, {self.top:g}, got {self.bottom:g}"
            )

    @property
    def size(self) -> int:
        """Number of cells N = A * E."""
        return self.columns * self.rows

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns), the shape of a picture of the grid."""
        return self.rows, self.columns

    @property
    def column_width(self) -> float:
        """Azimuth covered by a column, radians."""
        return 2 * np.pi / self.columns

    @property
    def row_height(self) -> float:
        """Elevation between two rows, radians."""
        return (self.top - self.bottom) / (self.rows - 1)

    @cached_property
    def spacing(self) -> GridSpacing:
        """The spacing of the grid, in the form that compiled code takes."""
        top = float(self.top)
        height = float(self.row_height)
        return GridSpacing(self.columns, self.rows, self.column_width, top, height)

    @cached_property
    def elevations(self) -> Floats:
        """(rows,) elevation of the rays of every row, radians, from the top."""
        elevations = np.linspace(self.top, self.bottom, self.rows)
        elevations.flags.writeable = False
        return elevations

    @cached_property
    def azimuths(self) -> Floats:
        """(columns,) azimuth of the rays of every column, the middle of its sector, radians."""
        middles = np.arange(self.columns, dtype=np.float64) + 0.5
        azimuths = np.asarray(middles * self.column_width - np.pi)
        azimuths.flags.writeable = False
        return azimuths

    @cached_property
    def fan(self) -> tuple[Floats, Floats]:
        """Cosine and sine of the azimuth of every column (columns, 2), and of the elevation of
        every row (rows, 2).
        """
        # A column is a sector, and its ray runs through the middle. A row is a ring: its elevation
        # is that of the ray itself.
        across, down = (
            np.stack([np.cos(angles), np.sin(angles)], axis=1)
            for angles in (self.azimuths, self.elevations)
        )
        across.flags.writeable = down.flags.writeable = False
        return across, down

    @cached_property
    def directions(self) -> Floats:
        """(N, 3) unit vectors of the rays, one through the centre of every cell."""
        (cos_az, sin_az), (cos_el, sin_el) = (angles.T for angles in self.fan)
        level = np.broadcast_to(sin_el[:, None], self.shape)
        forward = np.outer(cos_el, cos_az)
        left = np.outer(cos_el, sin_az)
        directions = np.stack([forward, left, level], axis=-1).reshape(-1, 3)
        # Whoever asks shares the table, and a write to it would change the grid for all.
        directions.flags.writeable = False
        return directions

    def cells_of(self, directions: ArrayLike) -> Cells:
        """The cell each direction (n, 3) falls in; -1 above the top or below the bottom row.

        Raises InvalidInput for a direction that holds NaN.
        """
        x, y, z = np.asarray(directions, dtype=float).reshape(-1, 3).T
        azimuth = np.arctan2(y, x)
        elevation = np.arctan2(z, np.hypot(x, y))
        if np.isnan(azimuth).any() or np.isnan(elevation).any():
            raise InvalidInput("directions must be numbers, none of them NaN")
        # The azimuth pi is -pi: it would fall in the column after the last, which is column 0.
        column = np.floor((azimuth + np.pi) / self.column_width).astype(np.int64)
        row = self._row(elevation)
        inside = (row >= 0) & (row < self.rows)
        return np.where(inside, row * self.columns + column % self.columns, -1)

    def hulls(
        self,
        boxes: ArrayLike,
        azimuth_margin: int | Integers = AZIMUTH_MARGIN,
        elevation_margin: int = ELEVATION_MARGIN,
    ) -> CellSets:
        """The dilated angular rectangle of every box, as ascending cells.

        `boxes` is (n, 7): centre x, y, z, length, width, height, yaw. `azimuth_margin` is one
        number, or one per box. A box that surrounds the sensor covers every column.
        """
        boxes = np.ascontiguousarray(boxes, dtype=float).reshape(-1, 7)
        if not len(boxes):
            return CellSets.of([])
        # Angles are taken by NumPy here and not in the kernel: its arctangent differs from that of
        # compiled code in the last bits, and published cells were made with it.
        planar, upright, around = silhouettes(boxes)
        azimuths = np.arctan2(planar[..., 1], planar[..., 0])
        elevations = np.arctan2(upright[..., 0], upright[..., 1])
        margins = np.where(around, self.columns, azimuth_margin)
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
        x, y, z = bundles[..., 0], bundles[..., 1], bundles[..., 2]
        azimuths = np.arctan2(y, x)
        elevations = np.arctan2(z, np.hypot(x, y))
        margins = np.full(len(bundles), azimuth_margin)
        return self._rectangles(azimuths, elevations, margins, elevation_margin)

    def _row(self, elevation: Floats) -> Integers:
        """The row whose ray is nearest to every elevation; on the grid or beyond it."""
        return np.floor((self.top - elevation) / self.row_height + 0.5).astype(np.int64)

    def _rectangles(
        self, azimuths: Floats, elevations: Floats, margins: Integers, elevation_margin: int
    ) -> CellSets:
        """The cells of every rectangle; see `care_sim.core.grid_kernels.rectangle_cells`."""
        return CellSets(
            *rectangle_cells(azimuths, elevations, margins, elevation_margin, self.spacing)
        )
