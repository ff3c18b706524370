"""Controls that see nothing: fixed patterns of cells."""

import math
from os import PathLike
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from care_sim.base.checks import check_number, check_whole
from care_sim.core.belief import Belief
from care_sim.core.cells.stack import Grid
from care_sim.core.grid import Cells, Head
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import FixedPolicy, Policy
from care_sim.policies.learned.weights import load_weights, shipped_weights
from care_sim.policies.paper.tracks import GOLDEN, uniform_pattern

LOWEST_DEG = -10.7
"""Lower edge of the fan, which begins at the horizon. The default grid's lowest row in the fan, at
-10.67 degrees, meets the road 9.8 m from the default sensor, 1.84 m above the road. The edge does
not depend on the rig's `sensor_height_m`.
"""


class Pattern(FixedPolicy):
    """Fires the first cells of `pattern` (N,) at every keyframe. With `shots` it demands fewer
    cells by this factor, and hardware that can fire a cell several times fires each as often.

    Raises InvalidInput for less than one shot.
    """

    tags: ClassVar[tuple[str, ...]] = ("causal", "control")
    source = "own: a pattern that never changes"
    is_pattern = True

    def __init__(self, rig: Rig, pattern: Cells, shots: int = 1):
        super().__init__(rig)
        check_whole("shots", shots, 1)
        self._pattern = pattern
        self._shots = shots

    def fixed(self, budget: int) -> Demand:
        """Return the same cells at every keyframe."""
        return Demand(layers=[[self._pattern[: budget // self._shots]]])


class Fan(Pattern):
    """Fires the road ahead, up to the horizon, the columns nearest to straight ahead first.

    The fan lies between the horizon and `LOWEST_DEG`. At 3% of the paper's grid it reaches 20
    degrees to either side. After a full turn the other rows follow in the same way. Several LiDARs
    make one fan. `shots` as in `Pattern`.
    """

    name = "fan"

    def __init__(self, rig: Rig, shots: int = 1):
        fans = [order_as_fan(rig.grid, is_low) for is_low in (True, False)]
        super().__init__(rig, np.concatenate(fans), shots)


def order_as_fan(grid: Grid, is_low: bool) -> Cells:
    """Return the cells between the horizon and `LOWEST_DEG`, or all others, the columns nearest to
    straight ahead first.
    """
    columns, off_ahead = [], []
    for head in grid.heads:
        own = head.grid
        elevations = own.elevations_ahead
        low = (elevations < own.row_height / 2) & (elevations > np.deg2rad(LOWEST_DEG))
        rows = head.first + np.flatnonzero(low == is_low) * own.columns
        columns += [rows + column for column in range(own.columns)]
        # In columns of the first LiDAR, whose own middles are half-integers.
        off_ahead.append(own.from_ahead * (own.column_width / grid.heads[0].grid.column_width))
    nearest = np.argsort(np.concatenate(off_ahead), kind="stable")
    return np.concatenate([columns[place] for place in nearest])


ENTRY_HEIGHT_M = 0.75
"""Height of the middle of a car 1.5 m high."""
ENTRY_DISTANCE_M = 50.0
"""The scored range, at which driving objects enter."""


class Rows(Pattern):
    """Fires the rows nearest to the elevation at which objects enter the range, nearest first.

    The last row is thinned evenly. The default elevation follows from the rig
    (`entry_elevation_deg`). `shots` as in `Pattern`. Raises InvalidInput for an impossible
    elevation.
    """

    name = "rows"

    def __init__(self, rig: Rig, elevation_deg: float | None = None, shots: int = 1):
        if elevation_deg is not None:
            check_number("elevation_deg", elevation_deg, -90, 90)
        super().__init__(rig, cells_by_row(rig, elevation_deg), shots)


def entry_elevation_deg(
    rig: Rig, above_m: float = 0.0, distance_m: float = ENTRY_DISTANCE_M
) -> float:
    """Return the elevation of a car's middle at a distance, by default the scored range, seen from
    the rig's first LiDAR. It is -1.25 degrees from the default LiDAR, 1.84 m above the road.
    Another LiDAR stands `above_m` higher.
    """
    # Rounded to a hundredth of a degree: results were published for -1.25 degrees, not for -1.2488.
    rise = (ENTRY_HEIGHT_M - (rig.sensor_height_m + above_m)) / distance_m
    return round(math.degrees(math.atan(rise)), 2)


def cells_by_row(rig: Rig, elevation_deg: float | None = None) -> Cells:
    """Return (N,) all cells, row after row, the row nearest to an elevation first, by default
    `entry_elevation_deg`. The first cells of a row are spread evenly over it. On a tilted grid the
    first such row holds the nearest cell of every column, and so on. Several LiDARs take turns cell
    by cell, so that all begin with their nearest rows.
    """
    parts = [
        _own_cells_by_row(
            head,
            entry_elevation_deg(rig, head.place[2]) if elevation_deg is None else elevation_deg,
        )
        for head in rig.grid.heads
    ]
    turns = np.concatenate([np.arange(len(part)) for part in parts])
    cells: Cells = np.concatenate(parts)[np.argsort(turns, kind="stable")]
    return cells


def _own_cells_by_row(head: Head, elevation_deg: float) -> Cells:
    """Return the cells of one LiDAR in the order of `cells_by_row`."""
    grid = head.grid
    off = np.abs(np.rad2deg(grid.elevations_everywhere) - elevation_deg)
    rows = np.broadcast_to(np.argsort(off, axis=0, kind="stable"), grid.shape)
    columns = np.argsort(np.arange(grid.columns) * GOLDEN % 1)
    cells: Cells = (rows[:, columns] * grid.columns + columns).ravel() + head.first
    return cells


def entry_cells(rig: Rig, distance_m: float = ENTRY_DISTANCE_M) -> Cells:
    """Return (lidars * columns,) the cell of every column nearest to a car's middle at a distance,
    by default where objects enter the scored range, LiDAR after LiDAR.
    """
    columns = rig.grid.columns
    nearest = [
        _own_cells_by_row(head, entry_elevation_deg(rig, head.place[2], distance_m))[:columns]
        for head in rig.grid.heads
    ]
    return np.concatenate([cells[np.argsort(cells % columns)] for cells in nearest])


class Stride(FixedPolicy):
    """Spends the whole budget on one even pattern over the whole grid, as `history-uniform` does
    with the reserve.
    """

    name = "stride"
    tags = ("causal", "control")
    source = "own: a pattern that never changes"
    is_pattern = True

    def fixed(self, budget: int) -> Demand:
        """Return the pattern of the budget."""
        return Demand(layers=[[uniform_pattern(self.rig.grid, budget)]])


class Sweep(Policy):
    """Fires whole columns in turn round the car, and resumes at the next keyframe where it stopped,
    like a slow spinning LiDAR.
    """

    name = "sweep"
    tags = ("causal", "control")
    source = "own: a pattern that turns"
    is_pattern = True

    def __init__(self, rig: Rig):
        super().__init__(rig)
        cells = np.arange(rig.grid.size).reshape(rig.grid.shape)
        self._turn = cells.T.ravel()
        self.reset()

    def reset(self) -> None:
        """Begin at column 0, which is straight behind on a grid that goes all round."""
        self._first = self._next = 0

    def remember(self, belief: Belief) -> None:
        """Advance by the budget."""
        self._first = self._next
        self._next = (self._first + belief.budget) % len(self._turn)

    def demand(self, belief: Belief) -> Demand:
        """Return the budget's next cells."""
        places = (self._first + np.arange(belief.budget)) % len(self._turn)
        return Demand(layers=[[self._turn[places]]])


class Place(Pattern):
    """Fires the cells with most first sightings on the calibration streets.

    It has a map and no sensor input: a policy with a camera must beat it.

    `path` is a map that `care-sim train place` wrote, by default the shipped one. Raises
    InvalidInput for another kind of file or another grid.
    """

    name = "place"
    tags = ("causal", "learned", "control")
    source = "own: a map that never changes"

    def __init__(self, rig: Rig, path: str | PathLike[str] | None = None):
        path = shipped_weights(self.name) if path is None else path
        super().__init__(rig, likeliest_cells(rig, path))


class TunedPlace(Place):
    """`place` with a map tuned to four counts: newcomers that emerge, newcomers that enter, objects
    kept, people kept. Cells are in greedy order on training streets, by the recall of CenterPoint.

    `path` is a map that `care-sim train tuned-place` wrote, by default the shipped one.
    """

    name = "tuned-place"
    source = "own: a map tuned to the score"


def likeliest_cells(rig: Rig, path: str | PathLike[str] | None) -> Cells:
    """Return (N,) all cells, those with most first sightings first, equal ones in the order of
    `rows`.
    """
    weights = load_weights(shipped_weights("place") if path is None else path)
    weights.check("place", rig)
    return likeliest_first(rig, weights.array("sightings", *rig.grid.shape).ravel())


def likeliest_first(rig: Rig, sightings: NDArray[np.floating]) -> Cells:
    """Return (N,) all cells by descending `sightings` (N,), equal ones in the order of `rows`."""
    # Most cells of a map have no sightings: without the rows, larger budgets would go to the sky.
    rows = cells_by_row(rig)
    return rows[np.argsort(-sightings[rows], kind="stable")]
