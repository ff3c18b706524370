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
cruising speed. Numbers and sources are those of `care_sim.core.conditions`.

With `brake_for_oncoming` the gap to a track with v_x < 0 is the least that it will have before it
leaves the strip, at most `brake_horizon_s` after it has entered: x - |v_x| * t for x. So an ego
that sees an oncoming car in time stands s_0 before all that the car will sweep, not in it. RSS for
opposite directions has the other brake, too; a car that crosses the ego's way need not, and leaves
the strip instead.
"""

import numpy as np

from care_sim.core.conditions import DriverSettings
from care_sim.core.types import Command, Ego, Tracks
from care_sim.driving.braking_kernels import BRAKE_OFF, Rules, decided


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
        self.guarded_m = guarded_m(half_width_m, rules)
        self._cruise_mps = float(cruise_mps)
        self._for_oncoming = rules.brake_for_oncoming
        self._rules = braking_rules(front_m, half_width_m, keyframe_s, rules)
        self._brake = BRAKE_OFF

    def command(self, tracks: Tracks, ego: Ego) -> Command:
        """Decide from the tracks of this keyframe, as they lie before a car that drives straight
        ahead, and the ego's motion.
        """
        rows = tracks.rows()
        headings = rows[:, Tracks.YAW]
        # The sines and cosines are NumPy's, on every machine, and the square is Python's.
        turns = np.cos(headings), np.sin(headings)
        speed = float(ego.speed), float(ego.speed) ** 2
        self._brake, acceleration, braking = decided(
            self._brake, rows, turns, speed, self._cruise_mps, self._for_oncoming, self._rules
        )
        return Command(acceleration, braking)


def guarded_m(half_width_m: float, rules: DriverSettings) -> float:
    """Width of the strip ahead that a car guards, metres."""
    return 2 * (half_width_m + rules.brake_side_margin_m)


def braking_rules(
    front_m: float, half_width_m: float, keyframe_s: float, rules: DriverSettings
) -> Rules:
    """The fields of `care_sim.driving.braking_kernels.BrakingRules`, as compiled code takes them at
    once; what is given is as in `BrakingController`.
    """
    return (
        float(front_m),
        float(guarded_m(half_width_m, rules) / 2),
        float(keyframe_s),
        float(rules.brake_mps2),
        float(rules.brake_reaction_s),
        float(rules.brake_standstill_m),
        float(rules.brake_horizon_s),
        float(rules.brake_release_s),
        float(rules.comfort_mps2),
    )
