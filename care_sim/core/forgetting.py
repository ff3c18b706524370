"""Algorithm 3 of the paper, with Eqs. 3 and 4: safety-bounded forgetting (SBF).

The hulls of harmless tracks shrink and are served after the full ones.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from care_sim.base.checks import bounded, check_fields
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.cells.boxes import planar_ranges
from care_sim.core.cells.sets import CellSets
from care_sim.core.grid import Cells, Head
from care_sim.core.rig import Rig
from care_sim.core.types import Ego, Tracks

VEHICLE_SIGMA_M = 0.4
"""sigma_pos on the paper's vehicle (Remark 3)."""


@dataclass(frozen=True)
class ForgettingRules:
    """Thresholds of SBF with the paper's values and sources (Remark 3)."""

    k_safe: float = bounded(2.0, 0, 1000)
    """Scale of the guard distance; 0 removes the guard."""
    standstill_m: float = bounded(2.0, 0, 1000)
    """s_0, jam distance of the intelligent driver model (Treiber et al. 2000)."""
    headway_s: float = bounded(2.0, 0, 1000)
    """T_h, the two-second rule (Vogel 2003)."""
    static_mps: float = bounded(0.5, 0, 1000)
    """tau_static, below adult walking speed (Bohannon 1997)."""
    receding_mps: float = bounded(1.0, 0, 1000)
    """tau_receding, clear radial departure."""
    position_sigma_m: float = bounded(0.0, 0, 1000)
    """sigma_pos of Eq. 4: zero in simulation, 0.4 on the paper's vehicle."""
    decay_per_keyframe: float = bounded(1.0, 0, 1000)
    """Columns of margin forgotten with each consecutive safe keyframe."""

    def __post_init__(self) -> None:
        check_fields(self)

    def guard_distance(self, ego_speed: float) -> float:
        """Eq. 3, metres: inside it nothing is ever forgotten, whichever way the car goes."""
        return self.k_safe * (self.standstill_m + abs(ego_speed) * self.headway_s)


class Forgetting:
    """Algorithm 3: streak counters of the tracks, and the hulls that follow from them.

    One instance lives as long as an episode. `advance` moves the streaks on and is called once per
    keyframe; the rest follows from them.
    """

    def __init__(self, rules: ForgettingRules, rig: Rig):
        self.rules = rules
        self._rig = rig
        self._streaks: dict[int, int] = {}

    def advance(self, tracks: Tracks, ego: Ego) -> None:
        """Advance the streaks by one keyframe."""
        low = self._low_criticality(tracks, ego).tolist()
        # A track that is gone is no key any more: if its id came back, its streak would begin anew.
        self._streaks = {
            track: self._streaks.get(track, 0) + 1 if is_low else 0
            for track, is_low in zip(tracks.ids.tolist(), low, strict=True)
        }

    def exploitation(self, tracks: Tracks) -> CellSets:
        """The exploitation sets for Algorithm 1: full hulls first, shrunk hulls second, each in the
        order of the tracks.
        """
        margins, low = self.margins(tracks)
        hulls = self._rig.hulls(tracks.boxes, margins)
        return hulls.take(np.argsort(low, kind="stable"))

    def margins(self, tracks: Tracks) -> tuple[Integers, Mask]:
        """How far each hull shrinks.

        Returns (n,) azimuth margins in columns, and (n,) which tracks are of low criticality. The
        margin in elevation is never dropped.
        """
        # A streak is as long as a track has been of low criticality, and 0 where it is not.
        streaks = np.array([self._streaks.get(track, 0) for track in tracks.ids.tolist()], float)
        low = streaks > 0

        # The margin shrinks with the streak, but never below what the uncertainty of the position
        # needs (Eq. 4).
        margin = self._rig.azimuth_margin
        decayed = np.ceil(margin - self.rules.decay_per_keyframe * streaks)
        needed = uncertainty_margin(self.rules.position_sigma_m, tracks.boxes, self._rig)
        shrunk = np.maximum(decayed, needed)
        return np.where(low, shrunk, margin).astype(np.int64), low

    def _low_criticality(self, tracks: Tracks, ego: Ego) -> Mask:
        """(n,) which tracks recede or stand still, beyond the guard distance."""
        ranges = np.maximum(tracks.ranges, 1e-9)
        # Velocities are over ground, but what recedes does so from the car, which drives along x.
        relative = tracks.velocities - [ego.speed, 0.0]
        range_rate = np.einsum("ij,ij->i", relative, tracks.boxes[:, :2]) / ranges
        receding = range_rate > self.rules.receding_mps
        static = np.hypot(*tracks.velocities.T) < self.rules.static_mps
        # A track seen once has no velocity yet: its 0 says nothing.
        harmless: Mask = (receding | static) & (tracks.hits > 1)
        return harmless & (ranges > self.rules.guard_distance(ego.speed))


def uncertainty_margin(position_sigma_m: float, boxes: Floats, rig: Rig) -> Floats:
    """m_unc of Eq. 4: (n,) whole columns for boxes (n, 7) whose positions are uncertain by
    `position_sigma_m`, at most the margin of a full hull. The LiDAR that needs the widest margin
    decides.
    """
    needed = np.max([_columns(position_sigma_m, boxes, head) for head in rig.grid.heads], 0)
    return np.asarray(np.minimum(needed, rig.azimuth_margin))


def _columns(position_sigma_m: float, boxes: Floats, head: Head) -> Floats:
    # The angle of a short arc is its length over its range, which must not be 0.
    angle = position_sigma_m / np.maximum(planar_ranges(head.boxes(boxes)), 1e-9)
    columns: Floats = np.ceil(angle / head.grid.column_width)
    return columns


def released_cells(hulls: Sequence[Cells], exploitation: Sequence[Cells], size: int) -> int:
    """Return how many cells of the full `hulls` are in no set of `exploitation`, in a grid of
    `size` cells.

    A cell that another hull holds on to is not released. The paper gives such a number (Sec. 5.4)
    and does not define it.
    """
    released = np.zeros(size, np.bool_)
    released[CellSets.of(hulls).cells] = True
    released[CellSets.of(exploitation).cells] = False
    return int(np.count_nonzero(released))
