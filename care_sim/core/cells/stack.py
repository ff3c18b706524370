"""The grids of several LiDARs as one, rows under rows: arrays of cells stay (rows, columns).

Every LiDAR looks from its own place, and along the axes of the sensor frame, which is that of the
first one. A cell is numbered as in a plain grid, `row * columns + column`; the rows are those of
the first LiDAR from its top to its bottom, then those of the second, and so on.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from care_sim.base.checks import check_number
from care_sim.base.errors import InvalidInput, shown
from care_sim.core.arrays import Floats, Integers
from care_sim.core.cells.rays import MOST_ROWS
from care_sim.core.cells.sets import CellSets
from care_sim.core.defaults import AZIMUTH_MARGIN, ELEVATION_MARGIN
from care_sim.core.grid import AngularGrid, Cells, Head, Place

MOST_APART_M = 40.0
"""Two LiDARs of a car are at most this far apart along each axis."""


@dataclass(frozen=True)
class GridStack:
    """The `grids` of several LiDARs, and the `places` (x, y, z) where they stand in the sensor
    frame, in metres: the first at its origin.

    It has what whoever fires cells needs of an `AngularGrid`. What belongs to the rows and columns
    of one LiDAR is asked of its `heads`, which a plain grid has, too. Raises InvalidInput for grids
    of different numbers of columns, more than 1,024 rows in all, and places that are none.
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
        object.__setattr__(self, "places", tuple(map(_place, places)))
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

    def __getstate__(self) -> dict[str, Any]:
        # Tables are megabytes: a copy, in a worker for example, makes its own.
        return {one.name: getattr(self, one.name) for one in fields(self)}

    def __deepcopy__(self, _copied: dict[int, Any]) -> Self:
        # Frozen: within a process a copy may share it, and its tables.
        return self

    @cached_property
    def heads(self) -> tuple[Head, ...]:
        """Its LiDARs one by one."""
        firsts = np.cumsum([0, *(grid.size for grid in self.grids)]).tolist()
        return tuple(map(Head, self.grids, self.places, firsts))

    @cached_property
    def head_rows(self) -> Integers:
        """(heads, 3) the first row and the last of each, and how many of its columns a whole turn
        would have.
        """
        return np.array([(*head.rows, head.grid.turn) for head in self.heads])

    @property
    def columns(self) -> int:
        """Columns of each."""
        return self.grids[0].columns

    @property
    def rows(self) -> int:
        """Rows of all."""
        return sum(grid.rows for grid in self.grids)

    @property
    def size(self) -> int:
        """Number of cells of all."""
        return self.columns * self.rows

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns), the shape of a picture of the stack."""
        return self.rows, self.columns

    @property
    def range_m(self) -> float:
        """The longest reach. A ray of any LiDAR that returns nothing reads it."""
        return max(grid.range_m for grid in self.grids)

    @property
    def column_width(self) -> float:
        """Radians, of the widest columns: between points of an object there are at most such."""
        return max(grid.column_width for grid in self.grids)

    @property
    def row_height(self) -> float:
        """Radians, of the LiDAR whose rows are farthest apart."""
        return max(grid.row_height for grid in self.grids)

    @property
    def top(self) -> float:
        """Elevation of the highest row of all, radians."""
        return max(grid.top for grid in self.grids)

    @property
    def goes_round(self) -> bool:
        """Whether the last column of every LiDAR borders on column 0."""
        return all(grid.goes_round for grid in self.grids)

    @cached_property
    def directions(self) -> Floats:
        """(N, 3) unit vectors of the rays, each from the place of its LiDAR."""
        directions = np.concatenate([grid.directions for grid in self.grids])
        directions.flags.writeable = False
        return directions

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
        return np.repeat(np.arange(len(self.grids)), [grid.size for grid in self.grids])

    def origins_of(self, cells: Cells) -> Floats:
        """(n, 3) where the rays of `cells` (n,) begin in the sensor frame."""
        return np.array(self.places)[self.lidars_of(cells)]

    def points(self, cells: Cells, ranges: Floats) -> Floats:
        """(n, 3) where rays of `cells` (n,) end after `ranges` (n,) metres, in the sensor frame."""
        return self.origins_of(cells) + self.directions[cells] * ranges[:, None]

    def ranges_to(self, cells: Cells, points: Floats) -> Floats:
        """(n,) how far points (n, 3) are from the LiDAR whose rays, of `cells` (n,), met them."""
        ranges: Floats = np.linalg.norm(points - self.origins_of(cells), axis=1)
        return ranges

    def stretched(self, cells: Cells, points: Floats, factors: Floats) -> Floats:
        """(n, 3) points (n, 3) that rays of `cells` (n,) met, at ranges `factors` (n,) times as
        long.
        """
        origins = self.origins_of(cells)
        stretched: Floats = origins + (points - origins) * factors[:, None]
        return stretched

    def reach_of(self, cells: Cells) -> Floats:
        """(n,) the reach of the rays of `cells` (n,), metres."""
        return np.array([grid.range_m for grid in self.grids], float)[self.lidars_of(cells)]

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


def _place(place: object) -> Place:
    if not (isinstance(place, tuple | list) and len(place) == 3):
        raise InvalidInput(f"places of a stack must be x, y and z in metres, got {shown(place)}")
    for metres in place:
        check_number("places of a stack", metres, -MOST_APART_M, MOST_APART_M)
    # Zero has no sign, which equality does not tell but a hash would.
    x, y, z = (float(metres) + 0.0 for metres in place)
    return x, y, z
