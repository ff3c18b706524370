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
"""The fan reaches from the horizon down to here. The lowest row of the default grid above it, at
-10.67 degrees, meets the road 9.8 m away from the default sensor, 1.84 m above it. It does not
follow the rig's `sensor_height_m`."""


class Pattern(FixedPolicy):
    """Fires the first cells of `pattern` (N,) at every keyframe. With `shots` it asks for as many
    times fewer cells, each of which hardware that fires cells several times then fires as often.

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
        """The same cells at every keyframe."""
        return Demand(layers=[[self._pattern[: budget // self._shots]]])


class Fan(Pattern):
    """Fires what lies ahead, up to the horizon, the columns nearest to straight ahead first.

    The fan lies between the horizon and `LOWEST_DEG`: at 3% of the paper's grid 20 degrees to
    either side. When the fan has gone all round, the other rows follow in the same way. Several
    LiDARs make one fan. `shots` are as of `Pattern`.
    """

    name = "fan"

    def __init__(self, rig: Rig, shots: int = 1):
        fans = [fanned(rig.grid, is_low) for is_low in (True, False)]
        super().__init__(rig, np.concatenate(fans), shots)


def fanned(grid: Grid, is_low: bool) -> Cells:
    """The cells between the horizon and `LOWEST_DEG`, or all others, the columns nearest to
    straight ahead first.
    """
    columns, off_ahead = [], []
    for head in grid.heads:
        own = head.grid
        elevations = own.elevations_ahead
        low = (elevations < own.row_height / 2) & (elevations > np.deg2rad(LOWEST_DEG))
        rows = head.first + np.flatnonzero(low == is_low) * own.columns
        columns += [rows + column for column in range(own.columns)]
        # In columns of the first LiDAR, whose own are whole ones and a half.
        off_ahead.append(own.from_ahead * (own.column_width / grid.heads[0].grid.column_width))
    nearest = np.argsort(np.concatenate(off_ahead), kind="stable")
    return np.concatenate([columns[place] for place in nearest])


ENTRY_HEIGHT_M = 0.75
"""Of the middle of a car 1.5 m high above the road."""
ENTRY_DISTANCE_M = 50.0
"""The range of scoring: what enters it by driving enters it there."""


class Rows(Pattern):
    """Fires the rows nearest to the elevation at which things enter the range, nearest first.

    The last row is thinned evenly. That elevation follows from the rig (`entry_elevation_deg`),
    unless one is given. `shots` are as of `Pattern`. Raises InvalidInput for an elevation that is
    none.
    """

    name = "rows"

    def __init__(self, rig: Rig, elevation_deg: float | None = None, shots: int = 1):
        if elevation_deg is not None:
            check_number("elevation_deg", elevation_deg, -90, 90)
        super().__init__(rig, cells_by_row(rig, elevation_deg), shots)


def entry_elevation_deg(rig: Rig, above_m: float = 0.0) -> float:
    """Where the middle of a car stands that enters the range of scoring, seen from the LiDAR of a
    rig: -1.25 degrees from the default one, 1.84 m above the road. Of several that is the first;
    another stands `above_m` higher.
    """
    # To a hundredth of a degree: results were published for -1.25 degrees, not for -1.2488.
    rise = (ENTRY_HEIGHT_M - (rig.sensor_height_m + above_m)) / ENTRY_DISTANCE_M
    return round(math.degrees(math.atan(rise)), 2)


def cells_by_row(rig: Rig, elevation_deg: float | None = None) -> Cells:
    """(N,) all cells, row after row, the row nearest to an elevation first: the given one, else
    `entry_elevation_deg`. Every first few cells of a row lie evenly over it. On a tilted grid every
    column gives its own nearest cell to the first such row, and so on. Of several LiDARs each gives
    a cell of its own in turn, so that all begin with their nearest rows.
    """
    parts = [_own_cells_by_row(rig, head, elevation_deg) for head in rig.grid.heads]
    turns = np.concatenate([np.arange(len(part)) for part in parts])
    cells: Cells = np.concatenate(parts)[np.argsort(turns, kind="stable")]
    return cells


def _own_cells_by_row(rig: Rig, head: Head, elevation_deg: float | None) -> Cells:
    """The cells of one LiDAR in that order."""
    grid = head.grid
    wanted = entry_elevation_deg(rig, head.place[2]) if elevation_deg is None else elevation_deg
    off = np.abs(np.rad2deg(grid.elevations_everywhere) - wanted)
    rows = np.broadcast_to(np.argsort(off, axis=0, kind="stable"), grid.shape)
    columns = np.argsort(np.arange(grid.columns) * GOLDEN % 1)
    cells: Cells = (rows[:, columns] * grid.columns + columns).ravel() + head.first
    return cells


def entry_cells(rig: Rig) -> Cells:
    """(lidars * columns,) the cell of every column at which things enter the range of scoring; of
    several LiDARs one after the other.
    """
    columns = rig.grid.columns
    nearest = [_own_cells_by_row(rig, head, None)[:columns] for head in rig.grid.heads]
    return np.concatenate([cells[np.argsort(cells % columns)] for cells in nearest])


class Stride(FixedPolicy):
    """Spends the whole budget on one even pattern over all the grid: what `history-uniform` does
    with the reserve.
    """

    name = "stride"
    tags = ("causal", "control")
    source = "own: a pattern that never changes"
    is_pattern = True

    def fixed(self, budget: int) -> Demand:
        """The pattern of the budget."""
        return Demand(layers=[[uniform_pattern(self.rig.grid, budget)]])


class Sweep(Policy):
    """Fires whole columns, one after the other round the car, and goes on at the next keyframe
    where it stopped: a slow LiDAR that spins.
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
        """Go on by the budget."""
        self._first = self._next
        self._next = (self._first + belief.budget) % len(self._turn)

    def demand(self, belief: Belief) -> Demand:
        """The budget's next cells."""
        places = (self._first + np.arange(belief.budget)) % len(self._turn)
        return Demand(layers=[[self._turn[places]]])


class Place(Pattern):
    """Fires the cells in which most first sightings were detected in the calibration's streets.

    It knows a place and sees nothing: what a policy with a camera must beat.

    `path` is a map that `care-sim train place` wrote; the shipped one, unless given. Raises
    InvalidInput for a file of something else or made for another grid.
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

    `path` is a map that `care-sim train tuned-place` wrote; the shipped one, unless given.
    """

    name = "tuned-place"
    source = "own: a map tuned to the score"


def likeliest_cells(rig: Rig, path: str | PathLike[str] | None) -> Cells:
    """(N,) all cells, those with most first sightings first; of equals, as `rows` has them."""
    weights = load_weights(shipped_weights("place") if path is None else path)
    weights.check("place", rig)
    return likeliest_first(rig, weights.array("sightings", *rig.grid.shape).ravel())


def likeliest_first(rig: Rig, sightings: NDArray[np.floating]) -> Cells:
    """(N,) all cells, those with the highest `sightings` (N,) first; of equals, as `rows` has
    them.
    """
    # Most cells of a map have none: without the rows, larger budgets would go to the sky.
    rows = cells_by_row(rig)
    return rows[np.argsort(-sightings[rows], kind="stable")]
