"""The fixed braking controller: the same for every policy, and stated here in full.

A track counts when its box overlaps the strip that the ego sweeps straight ahead. The box is
widened by `brake_side_margin_m` on both sides. The overlap may be now or within `brake_horizon_s`
at constant velocity. Only what lies ahead of the front bumper counts. A track seen once has no
velocity and counts only where it is.

The brake goes on when the gap to a counting track is at most the ego's stopping distance, v *
t_reaction + v^2 / (2 b) + s_0. The stopping distance of a track that drives ahead, v_x^2 / (2 b),
is subtracted (Shalev-Shwartz et al. 2017, RSS). It acts with b at the first keyframe that is at
least `brake_reaction_s` later. It stays on while any counting track is not faster than the ego, and
for `brake_release_s` after the last one. Then the ego gains speed at `comfort_mps2` up to its
cruising speed. Numbers and sources are those of `care_sim.core.conditions`.

With `brake_for_oncoming`, a track with v_x < 0 uses its smallest gap before it leaves the strip, x
- |v_x| * t. That is at most `brake_horizon_s` after the track has entered. So an ego that sees an
oncoming car in time stands s_0 before all that the car will sweep, not in it. RSS for opposite
directions has the other brake, too; a car that crosses the ego's way need not, and leaves the strip
instead.
"""

import math
from typing import NamedTuple

from care_sim.base.compiled import compiled
from care_sim.base.times import LAST_BITS_S
from care_sim.core.arrays import Floats
from care_sim.core.conditions import DriverSettings
from care_sim.core.types import Tracks
from care_sim.driving.corridor import Turns, enters, footprint, leaves_s

_X, _Y = Tracks.CENTRE.start, Tracks.CENTRE.start + 1
_LENGTH, _WIDTH = Tracks.BOX.start + 3, Tracks.BOX.start + 4
_VX, _VY = Tracks.VELOCITY.start, Tracks.VELOCITY.start + 1

Brake = tuple[float, float]
"""Seconds for which the brake has been on, NaN while it is off, and for which the way has been free
since."""
BRAKE_OFF = (math.nan, 0.0)
Rules = tuple[float, float, float, float, float, float, float, float, float]
"""The fields of `BrakingRules`."""


class BrakingRules(NamedTuple):
    """Rules of the braking decision, in the units of `care_sim.core.conditions.DriverSettings`.
    Adds where the guarded strip begins (`front_m`), its reach to either side (`reach_m`), and the
    time between keyframes.
    """

    front_m: float
    reach_m: float
    keyframe_s: float
    brake_mps2: float
    reaction_s: float
    standstill_m: float
    horizon_s: float
    release_s: float
    comfort_mps2: float


@compiled(error_model="numpy")
def decided(
    brake: Brake,
    tracks: Floats,
    turns: Turns,
    speed: tuple[float, float],
    cruise_mps: float,
    for_oncoming: bool,
    given: Rules,
) -> tuple[Brake, float, bool]:
    """The brake a keyframe later, the acceleration, and whether the brake is on.

    `tracks` (n, 13) are rows of `Tracks` as they lie before a car that drives straight ahead, and
    `turns` the cosines and sines (n,) of their headings. `speed` is the car's and its square. It
    cruises at `cruise_mps`; `for_oncoming` is the setting, and `given` holds the fields of
    `BrakingRules`.
    """
    rules = BrakingRules(*given)
    since_s, free_s = brake
    is_due, is_blocked = _weighed(tracks, turns, speed, for_oncoming, rules)
    if math.isnan(since_s):
        if is_due:
            since_s, free_s = 0.0, 0.0
    else:
        since_s += rules.keyframe_s
        free_s = 0.0 if is_blocked else free_s + rules.keyframe_s
        if free_s > rules.release_s - LAST_BITS_S:
            since_s = math.nan
    brake = since_s, free_s
    if math.isnan(since_s):
        wanted = (cruise_mps - speed[0]) / rules.keyframe_s
        return brake, min(max(wanted, -rules.comfort_mps2), rules.comfort_mps2), False
    is_acting = since_s >= rules.reaction_s - LAST_BITS_S
    return brake, -rules.brake_mps2 if is_acting else 0.0, True


@compiled(error_model="numpy")
def _weighed(
    tracks: Floats,
    turns: Turns,
    speed: tuple[float, float],
    for_oncoming: bool,
    rules: BrakingRules,
) -> tuple[bool, bool]:
    """Whether the gap to a track that counts is at most what the car needs to stop, and whether a
    track that counts is not faster than the car.
    """
    own_mps, squared = speed
    braking_m = squared / (2 * rules.brake_mps2)
    own_m = own_mps * rules.reaction_s + braking_m + rules.standstill_m
    strip = rules.front_m, rules.reach_m, rules.horizon_s
    is_due, is_blocked = False, False
    for n in range(len(tracks)):
        track = tracks[n]
        size = track[_LENGTH], track[_WIDTH]
        box = footprint((track[_X], track[_Y]), size, (turns[0][n], turns[1][n]))
        if not enters(box, track[_VY], strip):
            continue
        gap = track[_X] - box[2] - rules.front_m
        if for_oncoming:
            # How near it comes by itself before it has left the strip.
            gap += min(track[_VX], 0.0) * leaves_s(box, track[_VY], strip)
        ahead = max(track[_VX], 0.0)
        theirs_m = ahead * ahead / (2 * rules.brake_mps2)
        is_due |= gap <= own_m - theirs_m
        is_blocked |= track[_VX] <= own_mps
    return is_due, is_blocked


def guarded_m(half_width_m: float, rules: DriverSettings) -> float:
    """Width of the strip ahead that a car guards, metres."""
    return 2 * (half_width_m + rules.brake_side_margin_m)


def braking_rules(
    front_m: float, half_width_m: float, keyframe_s: float, rules: DriverSettings
) -> Rules:
    """The fields of `BrakingRules`, as compiled code takes them at once. `front_m` and
    `half_width_m` are the car's extents seen from its sensor, metres.
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
