"""The rays of the angular grid: columns, rows, and the direction of every cell.

Frame: sensor frame, x forward, y left, z up; metres and radians. It stays level: a LiDAR that is
tilted to the car turns the axes of its grid, about which the azimuths of columns and the elevations
of rows are measured.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Self

import numpy as np

from care_sim.base.checks import bounded, check_fields, check_number
from care_sim.base.errors import InvalidInput, shown
from care_sim.core.arrays import Floats

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

LEAST_VIEW = np.pi / 360
"""Radians, half a degree: the least horizontal field of view."""
MOST_TILT = np.pi / 4
"""Radians, of pitch and of roll: farther, a row would be nearer to upright than to level."""
MOST_COLUMNS, MOST_ROWS = 2**14, 2**10
"""Bounds of a grid: a thousand times the cells of the paper's."""
_LAST_BITS = 1e-6
"""The most that rounding may add to the columns of a turn."""


@dataclass(frozen=True)
class GridRays:
    """`columns` x `rows` rays; see `care_sim.core.grid.AngularGrid`, which adds what their cells
    hold.
    """

    columns: int = bounded(512, 1, MOST_COLUMNS)
    rows: int = bounded(32, 2, MOST_ROWS)
    top: float = bounded(float(np.deg2rad(10.67)), -np.pi / 2, np.pi / 2)
    bottom: float = bounded(float(np.deg2rad(-30.67)), -np.pi / 2, np.pi / 2)
    range_m: float = bounded(50.0, 1, 1_000_000)
    field_of_view: float = bounded(2 * np.pi, LEAST_VIEW, 2 * np.pi)
    heading: float = bounded(0.0, -np.pi, np.pi)
    listed: tuple[float, ...] = ()
    pitch: float = bounded(0.0, -MOST_TILT, MOST_TILT)
    roll: float = bounded(0.0, -MOST_TILT, MOST_TILT)

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
        pitch: float = 0.0,
        roll: float = 0.0,
    ) -> Self:
        """A grid whose rows have these elevations (rows,), radians, from the top. Raises
        InvalidInput unless they are two or more and descend.
        """
        listed = tuple(elevations)
        if len(listed) < 2:
            raise InvalidInput(f"elevations of the grid must be two or more, got {len(listed)}")
        ends = listed[0], listed[-1]
        mounted = {"heading": heading, "pitch": pitch, "roll": roll}
        return cls(columns, len(listed), *ends, range_m, field_of_view, listed=listed, **mounted)

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

    @cached_property
    def size(self) -> int:
        """Number of cells N = A * E."""
        return self.columns * self.rows

    @cached_property
    def shape(self) -> tuple[int, int]:
        """(rows, columns), the shape of a picture of the grid."""
        return self.rows, self.columns

    @cached_property
    def column_width(self) -> float:
        """Azimuth covered by a column, radians."""
        return self.field_of_view / self.columns

    @cached_property
    def right(self) -> float:
        """The azimuth at which column 0 begins, radians; the others follow to the left."""
        return self.heading - self.field_of_view / 2

    @cached_property
    def turn(self) -> int:
        """How many columns of this width a whole turn has: all are the grid's if it has no gap."""
        return round(2 * np.pi / self.column_width)

    @cached_property
    def goes_round(self) -> bool:
        """Whether the last column borders on column 0."""
        return self.columns == self.turn

    @cached_property
    def row_height(self) -> float:
        """Elevation between two rows, radians; the mean of it where rows are listed."""
        return (self.top - self.bottom) / (self.rows - 1)

    @cached_property
    def is_tilted(self) -> bool:
        """Whether its own up is not that of the sensor frame."""
        return self.pitch != 0 or self.roll != 0

    @cached_property
    def tilt(self) -> "Rotation":
        """From the grid's own axes to those of the sensor frame."""
        from scipy.spatial.transform import Rotation

        # Pitch and roll are about the LiDAR's own axes, and azimuths are counted from the car's.
        mount = Rotation.from_euler("ZYX", [self.heading, -self.pitch, self.roll])
        return mount * Rotation.from_euler("Z", -self.heading)

    @cached_property
    def elevations(self) -> Floats:
        """(rows,) elevation of the rays of every row about the grid's own axes, radians, from the
        top.
        """
        equal = np.linspace(self.top, self.bottom, self.rows)
        elevations = np.array(self.listed) if self.listed else equal
        elevations.flags.writeable = False
        return elevations

    @cached_property
    def elevations_everywhere(self) -> Floats:
        """(rows, columns) elevation of every cell above the horizon, radians; (rows, 1) of a level
        grid, whose columns are alike.
        """
        if not self.is_tilted:
            return self.elevations[:, None]
        heights = self.directions[:, 2].reshape(self.shape)
        elevations: Floats = np.arcsin(np.clip(heights, -1.0, 1.0))
        elevations.flags.writeable = False
        return elevations

    @property
    def elevations_ahead(self) -> Floats:
        """(rows,) elevation of every row above the horizon in the column that is nearest to
        straight ahead, radians.
        """
        if not self.is_tilted:
            return self.elevations
        return self.elevations_everywhere[:, int(np.argmin(self.from_ahead))]

    @cached_property
    def azimuths(self) -> Floats:
        """(columns,) azimuth of the rays of every column about the grid's own axes, radians, in
        [-pi, pi).
        """
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
        every row (rows, 2), about the grid's own axes.
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
        if self.is_tilted:
            directions = directions @ self.tilt.as_matrix().T
        # All callers share the table, and a write to it would change the grid for all.
        directions.flags.writeable = False
        return directions
