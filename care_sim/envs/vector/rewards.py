"""The reward of many episodes: `care_sim.envs.reward` over columns."""

from collections.abc import Mapping

import numpy as np

from care_sim.core.arrays import Floats, Mask
from care_sim.envs.reward import KEEP_CLEAR_M, weighted
from care_sim.loops.record_columns import Records


class Rewards:
    """The rewards of `worlds` worlds. `weights` holds one of every term."""

    def __init__(self, weights: Mapping[str, float], worlds: int):
        self._weights = weights
        self._in_view = np.zeros(worlds, np.bool_)
        self._detected = np.zeros(worlds, np.bool_)
        # Of the potential: the bound, NaN while it is not known, and what is lost so far.
        self._bound_m = np.full(worlds, np.nan)
        self._lost = np.zeros(worlds)

    def begin(self, world: int) -> None:
        """Begin an episode in a world."""
        self._in_view[world] = self._detected[world] = False
        self._bound_m[world], self._lost[world] = np.nan, 0.0

    @property
    def need_bound(self) -> Mask:
        """(W,) where the full-scan bound counts and is not known yet."""
        wanted: Mask = np.isnan(self._bound_m) & bool(self._weights["gain"])
        return wanted

    def of(
        self, records: Records, detectable: Mask, over: Mask, who: Mask
    ) -> tuple[Floats, dict[str, Floats]]:
        """The rewards (W,) of the next keyframe in the worlds `who`, and their terms; see
        `care_sim.envs.reward.EpisodeReward.of`.
        """
        lost = self._newly_lost(records, detectable, over, who)
        self._in_view |= records.in_view & who
        self._detected |= records.detected & who
        kept = np.minimum(np.maximum(records.clearance_m, 0.0), KEEP_CLEAR_M)
        closeness = 1.0 - kept / KEEP_CLEAR_M
        earned = {
            "delay": np.where(self._in_view & ~self._detected, -1.0, 0.0),
            "clearance": np.where(self._in_view & (closeness > 0), -closeness, 0.0),
            "collision": np.where(np.isnan(records.impact_speed_mps), 0.0, -1.0),
            "braking": np.where(records.braking & ~self._in_view, -1.0, 0.0),
            "gain": -lost,
        }
        return weighted(self._weights, earned), earned

    def _newly_lost(self, records: Records, detectable: Mask, over: Mask, who: Mask) -> Floats:
        """By how much the potential grows; see `care_sim.envs.reward.Potential`."""
        if not self._weights["gain"]:
            return np.zeros(len(who))
        found, before = self._detected, self._lost.copy()
        begins = who & np.isnan(self._bound_m) & (detectable | records.detected)
        self._bound_m[begins] = records.distance_m[begins]
        # Nothing is divided by a bound that there is not yet.
        counts = who & ~np.isnan(self._bound_m) & ~found
        bounds = np.where(counts, self._bound_m, 1.0)
        share = np.maximum(before, 1.0 - records.distance_m / bounds)
        share = np.where(over & ~records.detected, 1.0, share)
        self._lost = np.where(counts, share, before)
        return self._lost - before
