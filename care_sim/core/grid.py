"""The angular grid of firing cells, and the cells that boxes and ray bundles cover.

Frame: sensor frame, x forward, y left, z up; metres and radians. A cell's index is
`row * columns + column`; row 0 is the highest elevation and column c covers the azimuths
[right + c * width, right + (c + 1) * width). All round the car, which is the default, `right` is
-pi.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from care_sim.base.bounds import bounded, check_fields
from care_sim.base.checks import check_number
from care_sim.base.errors import InvalidInput, shown
from care_sim.core.arrays import Floats, Integers
from care_sim.core.cell_sets import CellSets
from care_sim.core.grid_kernels import GridSpacing, nearest_rows, rectangle_cells, silhouettes

Cells = NDArray[np.int64]

AZIMUTH_MARGIN = 2
"""Dilation of hulls and wedges, in columns (paper, Remark 2)."""
ELEVATION_MARGIN = 1
"""Dilation of hulls and wedges, in rows (paper, Remark 2)."""
LEAST_VIEW = np.pi / 360
"""Radians, half a degree: the least horizontal field of view."""
_LAST_BITS = 1e-6
"""What rounding may add to the columns of a turn."""
MOST_COLUMNS, MOST_ROWS = 2**14, 2**10
"""Bounds of a grid: a thousand times the cells of the paper's."""


@dataclass(frozen=True)
class AngularGrid:
    """`columns` x `rows` firing cells of a LiDAR.

    The defaults are the grid of the paper (Remark 1): 512 columns, and the 32 rings of the
    nuScenes sensor from +10.67 to -30.67 degrees in equal steps. `range_m` is the reach of a ray.

    The columns share a `field_of_view` (radians, horizontal) about the azimuth `heading`; their
    width must divide a whole turn. Rows that are not equally spaced are `listed`: their elevations,
    from the top, of which the first and the last are `top` and `bottom` (`of_elevations` makes such
    a grid). Raises InvalidInput for a value out of its bounds.
    """

    columns: int = bounded(512, 1, MOST_COLUMNS)
    rows: int = bounded(32, 2, MOST_ROWS)
    top: float = bounded(float(np.deg2rad(10.67)), -np.pi / 2, np.pi / 2)
    bottom: float = bounded(float(np.deg2rad(-30.67)), -np.pi / 2, np.pi / 2)
    range_m: float = bounded(50.0, 1, 1_000_000)
    field_of_view: float = bounded(2 * np.pi, LEAST_VIEW, 2 * np.pi)
    heading: float = bounded(0.0, -np.pi, np.pi)
    listed: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        check_fields(self, " of the grid")
        if self.bottom >= self.top:
            raise InvalidInput(
                f"bottom of the grid must lie below its top, {self.top:g}, got {self.bottom:g}"
            )
        turn = 2 * np.pi / self.column_width
        if abs(turn - round(turn)) > _LAST_BITS:
            raise InvalidInput(
                f"columns of the grid must have a width that divides a whole turn, got "
                f"{self.columns} in {np.rad2deg(self.field_of_view):g} degrees"
            )
        self._settle_listed()

    @classmethod
    def of_elevations(
        cls,
        elevations: Sequence[float],
        columns: int = 512,
        range_m: float = 50.0,
        field_of_view: float = 2 * np.pi,
        heading: float = 0.0,
    ) -> "AngularGrid":
        """A grid whose rows have these elevations (rows,), radians, from the top. Raises
        InvalidInput unless they are two or more and descend.
        """
        listed = tuple(elevations)
        if len(listed) < 2:
            raise InvalidInput(f"elevations of the grid must be two or more, got {len(listed)}")
        ends = listed[0], listed[-1]
        return cls(columns, len(listed), *ends, range_m, field_of_view, heading, listed)

    def _settle_listed(self) -> None:
        """Check the listed elevations, and make them a tuple of plain numbers."""
        listed = self.listed
        if not isinstance(listed, tuple | list) or len(listed) not in (0, self.rows):
            raise InvalidInput(
                f"listed of the grid must be the elevations of its {self.rows} rows, got "
                f"{shown(listed)}"
            )
        for elevation in listed:
            check_number("elevations of the grid", elevation, -np.pi / 2, np.pi / 2)
        ends = self.top, self.bottom
        if listed and not ((np.diff(listed) < 0).all() and (listed[0], listed[-1]) == ends):
            raise InvalidInput(
                f"elevations of the grid must descend from its top, {self.top:g}, to its bottom, "
                f"{self.bottom:g}"
            )
        object.__setattr__(self, "listed", tuple(map(float, listed)))

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
        return self.field_of_view / self.columns

    @property
    def right(self) -> float:
        """The azimuth at which column 0 begins, radians; the others follow to the left."""
        return self.heading - self.field_of_view / 2

    @property
    def turn(self) -> int:
        """How many columns of this width a whole turn has: all are the grid's if it has no gap."""
        return round(2 * np.pi / self.column_width)

    @property
    def row_height(self) -> float:
        """Elevation between two rows, radians; the mean of it where rows are listed."""
        return (self.top - self.bottom) / (self.rows - 1)

    @cached_property
    def spacing(self) -> GridSpacing:
        """The spacing of the grid, in the form that compiled code takes."""
        top = float(self.top)
        height = float(self.row_height)
        size = self.columns, self.rows
        listed = np.array(self.listed, float)
        return GridSpacing(*size, self.column_width, top, height, self.right, self.turn, listed)

    @cached_property
    def elevations(self) -> Floats:
        """(rows,) elevation of the rays of every row, radians, from the top."""
        equal = np.linspace(self.top, self.bottom, self.rows)
        elevations = np.array(self.listed) if self.listed else equal
        elevations.flags.writeable = False
        return elevations

    @cached_property
    def azimuths(self) -> Floats:
        """(columns,) azimuth of the rays of every column, radians, in [-pi, pi)."""
        # A column is a sector, and its ray runs through the middle. A row is a ring: its elevation
        # is that of the ray itself.
        middles = self.right + (np.arange(self.columns) + 0.5) * self.column_width
        azimuths = np.where(middles < np.pi, middles, middles - 2 * np.pi)
        azimuths = np.where(azimuths < -np.pi, azimuths + 2 * np.pi, azimuths)
        azimuths.flags.writeable = False
        return azimuths

    @cached_property
    def from_ahead(self) -> Floats:
        """(columns,) how many columns lie between the ray of each and straight ahead."""
        middles = np.abs(np.arange(self.columns) + 0.5 + self.right / self.column_width)
        away: Floats = np.minimum(middles, np.abs(self.turn - middles))
        away.flags.writeable = False
        return away

    @cached_property
    def fan(self) -> tuple[Floats, Floats]:
        """Cosine and sine of the azimuth of every column (columns, 2), and of the elevation of
        every row (rows, 2).
        """
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
        """The cell each direction (n, 3) falls in; -1 beyond the rows or the field of view.

        Raises InvalidInput for a direction that holds NaN.
        """
        x, y, z = np.asarray(directions, dtype=float).reshape(-1, 3).T
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
        x, y, z = bundles[..., 0], bundles[..., 1], bundles[..., 2]
        azimuths = np.arctan2(y, x)
        elevations = np.arctan2(z, np.hypot(x, y))
        margins = np.full(len(bundles), azimuth_margin)
        return self._rectangles(azimuths, elevations, margins, elevation_margin)

    def _rectangles(
        self, azimuths: Floats, elevations: Floats, margins: Integers, elevation_margin: int
    ) -> CellSets:
        """The cells of every rectangle; see `care_sim.core.grid_kernels.rectangle_cells`."""
        return CellSets(
            *rectangle_cells(azimuths, elevations, margins, elevation_margin, self.spacing)
        )
