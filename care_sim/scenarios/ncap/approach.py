"""How the ego and its target come to meet in the tests that go straight.

An ego that does not brake goes along x and has its front at `hit_x` at `hit_s`. Right-hand traffic.
"""

from functools import partial

import numpy as np

from care_sim.core.frames import Pose
from care_sim.scenarios.ncap.forms import Across, Ahead, BrakingAhead, Target
from care_sim.scenarios.ncap.meeting import CLEAR_M, Crossing, Ego, Following, Meeting
from care_sim.world.bodies import CATALOGUE
from care_sim.world.motions import StraightWay, Walk


def across(way: Across, target: Target, speed: float, ego: Ego) -> Meeting:
    """A target that comes from the right at `speed` m/s, from the left if far."""
    length, width, _ = CATALOGUE[target.body].size
    # The ego's front comes to the side of the target, whose middle line is half its width beyond.
    hit_x = ego.length / 2 + ego.speed * ego.hit_s
    line_x = hit_x + width / 2
    middle = ego.share(way.overlap) + target.point_m
    sign = -1.0 if way.far else 1.0
    heading = sign * np.pi / 2
    # Its tail has left the ego's way, the middle of which is 0.
    clear = (ego.width + length) / 2 + CLEAR_M
    motion: Walk | StraightWay
    if way.run_up_m:
        walk = run_up((line_x, -sign * way.start_m), heading, speed, way.run_up_m)
        motion = walk.setting_off(ego.hit_s - walk.duration_to(way.start_m + middle))
        clear_s = motion.starts_s + walk.duration_to(way.start_m + clear)
    else:
        motion = StraightWay((line_x, sign * middle), heading, speed, ego.hit_s)
        clear_s = ego.hit_s + (clear - middle) / speed
    reach = (ego.length + width) / 2
    return Meeting(motion.pose, Crossing(line_x - reach, line_x + reach + CLEAR_M, clear_s), line_x)


def ahead(way: Ahead, target: Target, speed: float, ego: Ego) -> Meeting:
    """A target that goes the ego's way at `speed` m/s, or stands."""
    hit_x = ego.length / 2 + ego.speed * ego.hit_s
    x = hit_x + CATALOGUE[target.body].size[0] / 2
    y = ego.share(way.overlap)
    if not way.run_up_m:
        standing = StraightWay((x, y), 0.0, speed, ego.hit_s)
        return Meeting(standing.pose, Following(speed))
    gone = way.run_up_m + way.steady_m
    walk = run_up((x - gone, y), 0.0, speed, way.run_up_m)
    moving = walk.setting_off(ego.hit_s - walk.duration_to(gone))
    return Meeting(moving.pose, Following(speed))


def braking_ahead(way: BrakingAhead, target: Target, ego: Ego) -> Meeting:
    """A car that drives ahead at the ego's speed and brakes."""
    start_x = (ego.length + CATALOGUE[target.body].size[0]) / 2 + way.headway_s * ego.speed
    final = way.final_kph / 3.6
    return Meeting(partial(_braking, way, start_x, ego.speed, final), Following(final))


def _braking(way: BrakingAhead, start_x: float, speed: float, final: float, time: float) -> Pose:
    """Return the pose of a car that starts at `start_x` and brakes from `speed` to `final` m/s."""
    longest_s = (speed - final) / way.deceleration
    braking = min(max(time - way.delay_s, 0.0), longest_s)
    after = max(time - way.delay_s - longest_s, 0.0)
    before = min(time, way.delay_s)
    way_m = speed * (before + braking) - way.deceleration * braking**2 / 2 + final * after
    return start_x + way_m, 0.0, 0.0


def run_up(start: tuple[float, float], heading: float, speed: float, over_m: float) -> Walk:
    """A walk without an end that gains its speed over `over_m`."""
    return Walk(start, heading, speed, acceleration=speed**2 / (2 * over_m), length_m=np.inf)
