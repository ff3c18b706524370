"""The fixed braking controller: the same for every policy, and stated here in full.

A track counts when its box, widened by `brake_side_margin_m` on both sides, overlaps the strip that
the ego sweeps straight ahead, now or at any time within `brake_horizon_s` if it keeps its velocity.
Only what lies ahead of the front bumper counts. A track seen once has no velocity and counts only
where it is.

The brake goes on when the gap to a counting track is at most the ego's stopping distance,
v * t_reaction + v^2 / (2 b) + s_0, less what a track that drives ahead needs to stop itself,
v_x^2 / (2 b) (Shalev-Shwartz et al. 2017, RSS). It acts with b at the first keyframe that is at
least `brake_reaction_s` later. It stays on while any counting track is not faster than the ego, and
for `brake_release_s` after the last one. Then the ego gains speed at `comfort_mps2` up to its
cruising speed. Numbers and sources are those of `care_sim.core.driver_settings`.

With `brake_for_oncoming` the gap to a track with v_x < 0 is the least that it will have before it
leaves the strip, at most `brake_horizon_s` after it has entered: x - |v_x| * t for x. So an ego
that sees an oncoming car in time stands s_0 before all that the car will sweep, not in it. RSS for
opposite directions has the other brake, too; a car that crosses the ego's way need not, and leaves
the strip instead.
"""

import numpy as np

from care_sim.base.times import LAST_BITS_S
from care_sim.core.arrays import Floats
from care_sim.core.boxes import half_extents
from care_sim.core.driver_settings import DriverSettings
from care_sim.core.types import Command, Ego, Tracks
from care_sim.driving.corridor import enters_strip, leaves_strip_s


class BrakingController:
    """Brakes on tracks. `front_m` and `half_width_m` are the ego's extents seen from its sensor,
    metres; it cruises at `cruise_mps`.
    """

    def __init__(
        self,
        cruise_mps: float,
        front_m: float,
        half_width_m: float,
        keyframe_s: float,
        rules: DriverSettings,
    ):
        self.guarded_m = 2 * (half_width_m + rules.brake_side_margin_m)
        self._cruise_mps = cruise_mps
        self._front_m = front_m
        self._keyframe_s = keyframe_s
        self._rules = rules
        self._braking_s: float | None = None
        self._free_s = 0.0

    def command(self, tracks: Tracks, ego: Ego) -> Command:
        """Decide from the tracks of this keyframe, as they lie before a car that drives straight
        ahead, and the ego's motion.
        """
        counting = enters_strip(
            tracks, self._front_m, self.guarded_m / 2, self._rules.brake_horizon_s
        )
        if self._braking_s is None:
            if counting.any() and self._is_due(tracks.take(counting), ego.speed):
                self._braking_s = 0.0
                self._free_s = 0.0
        else:
            self._braking_s += self._keyframe_s
            blocked = bool(np.any(counting & (tracks.velocities[:, 0] <= ego.speed)))
            self._free_s = 0.0 if blocked else self._free_s + self._keyframe_s
            if self._free_s > self._rules.brake_release_s - LAST_BITS_S:
                self._braking_s = None
        return self._act(ego.speed)

    def _is_due(self, counting: Tracks, speed: float) -> bool:
        """Whether the gap to a track that counts is at most what the ego needs to stop."""
        return bool(np.any(self._gaps(counting) <= self._stopping_distances(counting, speed)))

    def _act(self, speed: float) -> Command:
        if self._braking_s is None:
            wanted = (self._cruise_mps - speed) / self._keyframe_s
            comfort = self._rules.comfort_mps2
            return Command(float(min(max(wanted, -comfort), comfort)), False)
        acting = self._braking_s >= self._rules.brake_reaction_s - LAST_BITS_S
        return Command(-self._rules.brake_mps2 if acting else 0.0, True)

    def _gaps(self, tracks: Tracks) -> Floats:
        """(n,) metres between the front bumper and tracks that count."""
        half_x, _ = half_extents(tracks.boxes)
        gaps = tracks.boxes[:, 0] - half_x - self._front_m
        if not self._rules.brake_for_oncoming:
            return gaps
        in_strip_s = leaves_strip_s(tracks, self.guarded_m / 2, self._rules.brake_horizon_s)
        nearer: Floats = np.minimum(tracks.velocities[:, 0], 0.0) * in_strip_s
        return gaps + nearer

    def _stopping_distances(self, tracks: Tracks, speed: float) -> Floats:
        """(n,) gaps in metres at which the ego must begin to brake."""
        rules = self._rules
        braking = speed**2 / (2 * rules.brake_mps2)
        own = speed * rules.brake_reaction_s + braking + rules.brake_standstill_m
        theirs = np.maximum(tracks.velocities[:, 0], 0.0) ** 2 / (2 * rules.brake_mps2)
        return own - theirs
