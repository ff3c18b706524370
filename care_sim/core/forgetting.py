"""Algorithm 3 of the paper: safety-bounded forgetting (SBF) shrinks the hulls of harmless tracks."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from care_sim.base.bounds import bounded, check_fields
from care_sim.core.frames import Floats
from care_sim.core.grid import AZIMUTH_MARGIN, Cells
from care_sim.core.types import Ego, Tracks


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
    """Streak counters of Algorithm 3; one instance lives as long as an episode."""

    def __init__(self, rules: ForgettingRules, column_width: float, margin: int = AZIMUTH_MARGIN):
        self.rules = rules
        self.column_width = column_width
        self.margin = margin
        self._streaks: dict[int, int] = {}

    def margins(self, tracks: Tracks, ego: Ego) -> tuple[Cells, NDArray[np.bool_]]:
        """Advance the streaks by one keyframe: (n,) azimuth margins and (n,) which tracks are
        low-critical.
        """
        low = self._low_criticality(tracks, ego)
        ids = tracks.ids.tolist()
        self._streaks = {
            track: self._streaks.get(track, 0) + 1 if is_low else 0
            for track, is_low in zip(ids, low.tolist(), strict=True)
        }
        streaks = np.array([self._streaks[track] for track in ids], dtype=float)
        decayed = np.ceil(self.margin - self.rules.decay_per_keyframe * streaks)
        shrunk = np.clip(np.maximum(decayed, self._uncertainty(tracks.ranges)), 0, self.margin)
        return np.where(low, shrunk, self.margin).astype(np.int64), low

    def _low_criticality(self, tracks: Tracks, ego: Ego) -> NDArray[np.bool_]:
        ranges = np.maximum(tracks.ranges, 1e-9)
        relative = tracks.velocities - [ego.speed, 0.0]
        range_rate = np.einsum("ij,ij->i", relative, tracks.boxes[:, :2]) / ranges
        receding = range_rate > self.rules.receding_mps
        static = np.hypot(*tracks.velocities.T) < self.rules.static_mps
        harmless: NDArray[np.bool_] = (receding | static) & (tracks.hits > 1)
        return harmless & (ranges > self.rules.guard_distance(ego.speed))

    def _uncertainty(self, ranges: Floats) -> Floats:
        """m_unc of Eq. 4, in columns."""
        return np.ceil(self.rules.position_sigma_m / np.maximum(ranges, 1e-9) / self.column_width)
