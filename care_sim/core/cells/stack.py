"""The grids of several LiDARs as one, rows under rows: arrays of cells stay (rows, columns).

Every LiDAR looks from its own place, and along the axes of the sensor frame, which is that of the
first one. A cell is numbered as in a plain grid, `row * columns + column`. Rows are the first
LiDAR's from top to bottom, then the second's, and so on.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from care_sim.base.checks import checked_place
from care_sim.base.errors import InvalidInput, shown
from care_sim.core.arrays import Floats, Integers
from care_sim.core.cells.rays import MOST_ROWS
from care_sim.core.cells.sets import CellSets
from care_sim.core.defaults import AZIMUTH_MARGIN, ELEVATION_MARGIN
from care_sim.core.grid import AngularGrid, Head, HeadCells, Place

MOST_APART_M = 40.0
"""Two LiDARs of a car are at most this far apart along each axis."""


@dataclass(frozen=True)
class GridStack(HeadCells):
    """The `grids` of several LiDARs, and the `places` (x, y, z) where they stand in the sensor
    frame, in metres: the first at its origin.

    It has all of an `AngularGrid` that firing cells needs. Its `heads`, which a plain grid has too,
    hold the rows and columns of one LiDAR each. Raises InvalidInput for grids of different numbers
    of columns, more than 1,024 rows in all, and places that are none.
    """

    grids: tuple[AngularGrid, ...]
    places: tuple[Place, ...]

    def __post_init__(self) -> None:
        grids, places = self.grids, self.places
        if not (
            isinstance(grids, tuple | list)
            and grids
            and all(isinstance(grid, AngularGrid) for grid in grids)
        ):
            raise InvalidInput(f"grids of a stack must be AngularGrids, got {shown(grids)}")
        if not isinstance(places, tuple | list) or len(places) != len(grids):
            raise InvalidInput(
                f"places of a stack must be one for each of its {len(grids)} grids, got "
                f"{shown(places)}"
            )
        object.__setattr__(self, "grids", tuple(grids))
        apart = -MOST_APART_M, MOST_APART_M
        settled = (checked_place("places of a stack", place, apart) for place in places)
        object.__setattr__(self, "places", tuple(settled))
        if any(self.places[0]):
            raise InvalidInput(
                f"places of a stack must begin at 0, 0, 0, the first LiDAR, got {self.places[0]}"
            )
        if len(columns := sorted({grid.columns for grid in grids})) > 1:
            raise InvalidInput(
                f"LiDARs of one set-up must have as many columns each, got {columns[0]} and "
                f"{columns[-1]}: give all the same number, each over its own field of view"
            )
        if self.rows > MOST_ROWS:
            raise InvalidInput(
                f"LiDARs of one set-up must have at most {MOST_ROWS} rows in all, got {self.rows}"
            )

    @cached_property
    def heads(self) -> tuple[Head, ...]:
        """Its LiDARs one by one."""
        firsts = np.cumsum([0, *(grid.size for grid in self.grids)]).tolist()
        return tuple(map(Head, self.grids, self.places, firsts))

    @cached_property
    def columns(self) -> int:
        """Columns of each."""
        return self.grids[0].columns

    @cached_property
    def rows(self) -> int:
        """Rows of all."""
        return sum(grid.rows for grid in self.grids)

    @cached_property
    def size(self) -> int:
        """Number of cells of all."""
        return self.columns * self.rows

    @cached_property
    def shape(self) -> tuple[int, int]:
        """(rows, columns), the shape of a picture of the stack."""
        return self.rows, self.columns

    @cached_property
    def range_m(self) -> float:
        """The longest reach. A ray of any LiDAR that returns nothing reads it."""
        return max(grid.range_m for grid in self.grids)

    @cached_property
    def column_width(self) -> float:
        """Radians, of the widest columns: between points of an object there are at most such."""
        return max(grid.column_width for grid in self.grids)

    @cached_property
    def row_height(self) -> float:
        """Radians, of the LiDAR whose rows are farthest apart."""
        return max(grid.row_height for grid in self.grids)

    @cached_property
    def top(self) -> float:
        """Elevation of the highest row of all, radians."""
        return max(grid.top for grid in self.grids)

    @cached_property
    def goes_round(self) -> bool:
        """Whether the last column of every LiDAR borders on column 0."""
        return all(grid.goes_round for grid in self.grids)

    @cached_property
    def directions(self) -> Floats:
        """(N, 3) unit vectors of the rays, each from the place of its LiDAR."""
        directions = np.concatenate([grid.directions for grid in self.grids])
        directions.flags.writeable = False
        return directions

    def hulls(
        self,
        boxes: ArrayLike,
        azimuth_margin: int | Integers = AZIMUTH_MARGIN,
        elevation_margin: int = ELEVATION_MARGIN,
    ) -> CellSets:
        """The cells that every box covers, seen from each LiDAR and dilated by as many of its
        columns and rows; see `AngularGrid.hulls`.
        """
        boxes = np.asarray(boxes, dtype=float).reshape(-1, 7)
        margins = azimuth_margin, elevation_margin
        return self._united(lambda head: head.grid.hulls(head.boxes(boxes), *margins), len(boxes))

    def wedges(
        self,
        bundles: ArrayLike,
        azimuth_margin: int = AZIMUTH_MARGIN,
        elevation_margin: int = ELEVATION_MARGIN,
        starts: Floats | None = None,
    ) -> CellSets:
        """The cells of every LiDAR behind each image box; see `AngularGrid.wedges`. Without
        `starts` the rays begin at the first.
        """
        bundles = np.asarray(bundles, dtype=float)
        begun = np.zeros((len(bundles), 3)) if starts is None else starts
        margins = azimuth_margin, elevation_margin
        return self._united(
            lambda head: head.grid.wedges(bundles, *margins, head.points(begun)), len(bundles)
        )

    def _united(self, sets_of: Callable[[Head], CellSets], count: int) -> CellSets:
        """`count` sets, each of the cells that it has of all LiDARs, ascending."""
        found = []
        for head in self.heads:
            own = sets_of(head)
            found.append(CellSets(own.cells + head.first, own.sizes))
        # All sets of a LiDAR come together; they are put set by set, and stay apart till then.
        sizes = np.stack([sets.sizes for sets in found])
        order = np.arange(len(found) * count).reshape(len(found), count).T.ravel()
        return CellSets(CellSets.joined(found).take(order).cells, sizes.sum(axis=0))


Grid = AngularGrid | GridStack
"""The cells that a set-up of one or several LiDARs fires."""
