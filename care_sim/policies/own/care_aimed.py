"""CARE that aims: few cells per target, where the target returns most, and many for what is new in
the picture.
"""

import math

import numpy as np

from care_sim.base.checks import check_flags, check_whole
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.belief import Belief
from care_sim.core.cells.sets import CellSets
from care_sim.core.defaults import AS_DEMANDED
from care_sim.core.residual import explained, wedges
from care_sim.core.rig import Rig
from care_sim.core.types import Demand, Ego
from care_sim.policies.base import Policy
from care_sim.policies.controls.patterns import cells_by_row, entry_cells
from care_sim.policies.own.box_places import ON_FOOT, box_places
from care_sim.policies.own.care import CORE_FIRST
from care_sim.policies.own.sight_lines import columns_ahead

FRONT_RAD = math.radians(60)
"""Half of the front that is watched. Four in five emerging newcomers without a camera box appear
within it (streets 2000 to 2031)."""
SECOND_M = 25.0
"""The second row that is watched is where the middle of a car is at this range."""
HULL_CELLS = 3
"""First cells of each hull. Two returns keep nine of ten tracked objects (streets 2000 to 2007)."""
OLD_CELLS = 3
"""First cells of a box that is unexplained, but not new."""
NEW_CELLS, NEW_MOST = 24, 48
"""First cells of a new box, and all that it gets: often most of what the box shows is hidden."""
MORE_CELLS = 8
"""Further cells of each hull."""
AIM_HEIGHT = 0.4
"""Where cells come first: this share of the target's height below its top. Obstacles hide the
lower part of a target, and a head is narrow."""
ROW_WEIGHT = 4.5
"""Weight of the height against the width: a target's height counts as so many half widths."""
MATCH_M, MATCH_SHARE = 3.0, 0.3
"""Two boxes can show one object if their places differ by less than this, or by less than this
share of the range. The larger bound holds, because a range by the height of a box is rough."""
Pictured = tuple[Floats, Mask]
"""Content of the boxes of a picture: places (n, 2) in metres, and whether each is on foot."""


class CareAimed(Policy):
    """The paper's residual, also against the previous picture, with few well-placed cells per set.

    The first layer takes many cells of each unexplained box that the previous picture did not show.
    The second is the row at which things enter the range, within 60 degrees of straight ahead.
    Three cells of each hull follow, then three cells of each older unexplained box. Then come the
    rest of the new boxes and eight more cells of each hull. The last layers are a second row below
    the first, as wide; the rest of the first row; the pattern `rows`. Each set begins in its
    middle, a little above half its height, unless the rig has a cell order.

    Each idea can be switched off, to measure its worth. Without `residual`, every box counts as
    unexplained. Without `new`, each unexplained box counts as new. `tracks` are the hulls, `front`
    the early rows. Without `aim`, each set begins with its core, spread.
    """

    name = "care-aimed"
    source = "own: the residual against the last picture too, three cells per hull, the front row"
    keeps_order = True

    def __init__(
        self,
        rig: Rig,
        hull_cells: int = HULL_CELLS,
        residual: bool = True,
        tracks: bool = True,
        aim: bool = True,
        new: bool = True,
        front: bool = True,
    ):
        super().__init__(rig)
        check_whole("hull_cells", hull_cells, 1)
        check_flags(residual=residual, tracks=tracks, aim=aim, new=new, front=front)
        self._few = hull_cells
        self._uses_residual, self._follows = residual, tracks
        self._aims, self._compares = aim, new
        self._rows = cells_by_row(rig)
        self._entries = entry_cells(rig)
        ahead = columns_ahead(rig.grid, FRONT_RAD)
        rows = self._entries, entry_cells(rig, SECOND_M)
        self._front, self._second = ([row[ahead]] if front else [] for row in rows)
        self.reset()

    def reset(self) -> None:
        """Forget the previous picture."""
        nothing = np.empty((0, 2)), np.empty(0, bool)
        self._pictured: Pictured = nothing
        self._before: Pictured = nothing

    def remember(self, belief: Belief) -> None:
        """Move the previous picture with the car, and keep this one for the next keyframe."""
        places, on_foot = self._pictured
        self._before = standing_still(places, belief.ego, self.rig.keyframe_s), on_foot
        self._pictured = self._picture(belief)

    def demand(self, belief: Belief) -> Demand:
        """Layers in order of priority; see the class."""
        detections = belief.detections
        residual = np.ones(len(detections), bool)
        if self._uses_residual:
            residual = ~explained(detections, belief.tracks, self.rig)
        new = residual.copy()
        if self._compares:
            new &= ~have_counterparts(self._picture(belief), self._before)
        fresh = self._listed(wedges(detections.take(new), self.rig), NEW_MOST)
        older = self._listed(wedges(detections.take(residual & ~new), self.rig), OLD_CELLS)
        tracked = belief.tracks.boxes[: None if self._follows else 0]
        hulls = self._listed(self.rig.hulls(tracked), self._few + MORE_CELLS)
        return Demand(
            layers=[
                fresh.part(0, NEW_CELLS),
                self._front,
                hulls.part(0, self._few),
                older,
                fresh.part(NEW_CELLS, NEW_MOST),
                hulls.part(self._few, self._few + MORE_CELLS),
                self._second,
                [self._entries],
                [self._rows[: belief.budget]],
            ]
        )

    def _picture(self, belief: Belief) -> Pictured:
        detections = belief.detections
        return box_places(detections, self.rig)[:, :2], ON_FOOT[detections.classes]

    def _listed(self, sets: CellSets, most: int) -> CellSets:
        if self._aims and self.rig.cell_order == AS_DEMANDED:
            return aimed(sets, self.rig).part(0, most)
        return self.rig.listed(sets, CORE_FIRST, most)


def aimed(sets: CellSets, rig: Rig) -> CellSets:
    """Return the sets, which margins of the rig dilate, the cells nearest to the aim first: the
    middle of the columns, `AIM_HEIGHT` of the rows below the top. Each LiDAR aims by itself.
    """
    columns = rig.grid.columns
    owner = np.repeat(np.arange(len(sets)), sets.sizes)
    _, group = np.unique(
        owner * len(rig.grid.heads) + rig.grid.lidars_of(sets.cells), return_inverse=True
    )
    rows = sets.cells // columns
    # Columns count from any one of the group, so that the seam does not part a set.
    _, first = np.unique(group, return_index=True)
    half_turn = columns // 2
    across = (sets.cells - sets.cells[first][group] + half_turn) % columns - half_turn
    left, right = _bounds(across, group)
    top, bottom = _bounds(rows, group)

    half_width = np.maximum((right - left + 1) / 2 - rig.azimuth_margin, 1.0)
    height = np.maximum(bottom - top + 1 - 2 * rig.elevation_margin, 1.0)
    beside = (across - (left + right) / 2) / half_width
    below = (rows + 0.5 - top - rig.elevation_margin) / height - AIM_HEIGHT
    order = np.lexsort((beside**2 + (ROW_WEIGHT * below) ** 2, owner))
    return CellSets(sets.cells[order], sets.sizes)


def _bounds(values: Integers, group: Integers) -> tuple[Integers, Integers]:
    """Return the least and the largest value of the group of each value, both (n,)."""
    least = np.full(len(values), values.max(initial=0))
    largest = np.full(len(values), values.min(initial=0))
    np.minimum.at(least, group, values)
    np.maximum.at(largest, group, values)
    return least[group], largest[group]


def standing_still(places: Floats, ego: Ego, seconds: float) -> Floats:
    """(n, 2) where places that stand still are after the car has driven on."""
    turn = ego.yaw_rate * seconds
    cos, sin = math.cos(turn), math.sin(turn)
    x, y = places[:, 0] - ego.speed * seconds, places[:, 1]
    return np.column_stack([cos * x + sin * y, cos * y - sin * x])


def have_counterparts(now: Pictured, before: Pictured) -> Mask:
    """(n,) which boxes of now have a counterpart before, one to one, the nearest pairs first.
    Someone on foot and a vehicle are no pair; detectors often confuse classes of vehicles.
    """
    (places, on_foot), (old, old_on_foot) = now, before
    gaps = np.linalg.norm(places[:, None] - old[None], axis=2)
    gaps /= np.maximum(MATCH_M, MATCH_SHARE * np.linalg.norm(places, axis=1))[:, None]
    gaps[on_foot[:, None] != old_on_foot[None]] = np.inf
    found, taken = np.zeros(len(places), bool), np.zeros(len(old), bool)
    for pair in np.argsort(gaps, axis=None, kind="stable"):
        row, column = divmod(int(pair), len(old))
        if gaps[row, column] >= 1:
            break
        if not (found[row] or taken[column]):
            found[row] = taken[column] = True
    return found
