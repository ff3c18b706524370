"""Meetings of the ego and its target, on straight ways and in turns, and the end of a test.

A test ends as the protocol's does, in one of four cases. There is a contact, the ego stands before
the target's way, the target has left the ego's, or the ego is no faster than the target that it
follows.

An ego that does not brake goes along x and has its front at the target at `hit_s`. Right-hand
traffic. In a turn the ego's first lane is along x with its middle at y = 0, at a junction of two
roads with two lanes of 3.5 m each. The middle of the car follows the protocol's line; the protocol
leads the middle of the front axle along it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from care_sim.core.frames import Pose
from care_sim.scenarios.ncap.table import (
    Across,
    AcrossExit,
    Ahead,
    Bend,
    BrakingAhead,
    Obstruction,
    ParkedAlong,
    StandingAcross,
    Target,
    WaitingBeside,
)
from care_sim.streets.layouts import LANE_WIDTH_M
from care_sim.world.bodies import CATALOGUE, BodyKind, Triple, sized
from care_sim.world.motions import StraightWay, Walk
from care_sim.world.route import Leg, Route
from care_sim.world.world import Motion, World

CLEAR_M = 0.2
"""Distance without contact: far more than the centimetres by which hulls are padded."""


@dataclass(frozen=True)
class Ego:
    """Speed in m/s, size in metres, and when its front hits if it does not brake."""

    speed: float
    length: float
    width: float
    hit_s: float

    def share(self, overlap: float) -> float:
        """Return the distance from the middle of a place at a share of the width, in the direction
        of growing share.
        """
        return self.width * (overlap - 0.5)


@dataclass(frozen=True)
class Crossing:
    """Crossing ways.

    The ego's front enters the target's way when its centre has gone `enter_m`, and its rear leaves
    it at `leave_m`. The target has left the ego's way at `clear_s`.
    """

    enter_m: float
    leave_m: float
    clear_s: float

    def is_over(self, world: World) -> bool:
        """Whether no contact can follow."""
        gone = world.along_m
        stands_before = world.ego.speed == 0.0 and gone < self.enter_m
        return world.time >= self.clear_s or gone > self.leave_m or stands_before


@dataclass(frozen=True)
class Following:
    """The target goes ahead of the ego, in the end at `speed` m/s."""

    speed: float

    def is_over(self, world: World) -> bool:
        """Whether the ego is no faster than the target."""
        return world.ego.speed <= self.speed


@dataclass(frozen=True)
class Meeting:
    """The target's motion and the end of the test. Also the middle line x of a crossing target's
    way, which obstructions follow, and the ego's route in a turn.
    """

    motion: Motion
    end: Crossing | Following
    line_x: float = 0.0
    route: Route | None = None


def across(way: Across, target: Target, speed: float, ego: Ego) -> Meeting:
    """Return the meeting with a target that comes from the right at `speed` m/s, from the left if
    far.
    """
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
    """Return the meeting with a target ahead on the ego's way, at `speed` m/s or standing."""
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
    """Return the meeting with a car that drives ahead at the ego's speed and brakes."""
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


_SLACKEST_M = 1500.0
"""Radius at which the clothoids begin."""
_ARCS = 16
"""Arcs that stand for a clothoid."""
_BEYOND_M = 50.0
"""Distance behind the bend at which a car has passed any requested line."""


def bend_route(bend: Bend, right: bool, before_m: float) -> Route:
    """The ego's route: `before_m` straight on, then a quarter turn."""
    sign = -1.0 if right else 1.0
    tight, slack = 1 / bend.radius_m, 1 / _SLACKEST_M
    length = 2 * float(np.deg2rad(bend.clothoid_deg)) / (tight + slack)
    # The curvature of a clothoid grows evenly: each arc has that of its middle, and so turns as
    # much as its part of the clothoid.
    shares = (np.arange(_ARCS) + 0.5) / _ARCS
    entry: list[Leg] = [
        (length / _ARCS, sign * float(slack + share * (tight - slack))) for share in shares
    ]
    arc = (float(np.deg2rad(bend.arc_deg)) * bend.radius_m, sign * tight)
    return Route((0.0, 0.0, 0.0), ((before_m, 0.0), *entry, arc, *reversed(entry)))


def across_exit(way: AcrossExit, target: Target, speed: float, bend: Bend, ego: Ego) -> Meeting:
    """Return the meeting with a pedestrian who crosses the road that the ego turns into at `speed`
    m/s.
    """
    length, width, _ = CATALOGUE[target.body].size
    side = -1.0 if way.right else 1.0
    line_y = LANE_WIDTH_M / 2 + side * way.offset_m
    hit_y = line_y - side * width / 2
    route = _timed(bend, way.right, ego, lambda on, m: side * (_front(on, m, ego)[1] - hit_y))
    hit_m = ego.speed * ego.hit_s
    hit_x = _front(route, hit_m, ego)[0]

    exit_x = route.pose(route.length)[0]
    sign = 1.0 if way.along else -1.0
    start_x = exit_x - sign * (way.distance_m - target.point_m)
    heading = 0.0 if way.along else float(np.pi)
    walk = run_up((start_x, line_y), heading, speed, way.run_up_m)
    gone = sign * (hit_x - start_x) + target.point_m
    walk = walk.setting_off(ego.hit_s - walk.duration_to(gone))
    # The ego may still turn when it is there, so that both wait for a width of it more.
    clear_s = walk.starts_s + walk.duration_to(gone + length / 2 + 1.5 * ego.width + CLEAR_M)
    leave_m = hit_m + ego.length + width + ego.width + CLEAR_M
    return Meeting(walk.pose, Crossing(hit_m - ego.width / 2, leave_m, clear_s), route=route)


def oncoming(target: Target, speed: float, bend: Bend, ego: Ego) -> Meeting:
    """Return the meeting with an oncoming car at `speed` m/s, before which the ego turns left."""
    length, width, _ = CATALOGUE[target.body].size
    # The ego's front has come to the target's side: half its width before the middle of its lane,
    # seen at 45 degrees.
    short_m = ego.length / 2 + width / np.sqrt(2)
    lane_y = LANE_WIDTH_M
    route = _timed(bend, False, ego, lambda on, m: on.pose(m + short_m)[1] - lane_y)
    hit_m = ego.speed * ego.hit_s
    crossing_x = route.pose(hit_m + short_m)[0]
    motion = StraightWay((crossing_x + length / 2, lane_y), float(np.pi), speed, ego.hit_s)
    # Either is off the other's way when it has gone on by both lengths and the ego's width.
    further = length + ego.length + ego.width
    reach = (width + ego.width) / 2
    enter_m = _where(route, lambda on, m: _front(on, m, ego)[1] - (lane_y - reach))
    leave_m = _where(route, lambda on, m: on.pose(m)[1] - (lane_y + reach)) + ego.length
    return Meeting(
        motion.pose, Crossing(enter_m, leave_m, ego.hit_s + further / speed), route=route
    )


_Distance = Callable[[Route, float], float]
"""A distance that grows with the metres along a route."""


def _timed(bend: Bend, right: bool, ego: Ego, beyond: _Distance) -> Route:
    """The route on which `beyond` is 0 when an ego that does not brake is due to hit."""
    # Tried with a straight of any length; the real one is as much shorter or longer.
    before_m = ego.length
    tried = bend_route(bend, right, before_m)
    return bend_route(bend, right, before_m + ego.speed * ego.hit_s - _where(tried, beyond))


def _where(route: Route, beyond: _Distance) -> float:
    """Where along a route a distance comes to 0."""
    from scipy.optimize import brentq

    return float(brentq(lambda along: beyond(route, along), 0.0, route.length + _BEYOND_M))


def _front(route: Route, along: float, ego: Ego) -> tuple[float, float]:
    """The middle of the front of an ego whose centre is `along` metres down a route."""
    x, y, heading = route.pose(along)
    reach = ego.length / 2
    return x + reach * float(np.cos(heading)), y + reach * float(np.sin(heading))


Car = tuple[BodyKind, Pose]
"""A car and where it stands."""


def standing_cars(
    obstruction: Obstruction | None,
    small: Triple,
    large: Triple,
    line_x: float,
    target_width: float,
    ego_width: float,
) -> list[Car]:
    """The cars of an obstruction, for a target from the right. The middle line of the target's way
    is at x = `line_x`; the ego's is y = 0. `small` and `large` are length, width and height.
    """
    side_x = line_x - target_width / 2
    match obstruction:
        case ParkedAlong():
            # Both have the middle line of the large one.
            y = -(ego_width / 2 + obstruction.beside_m + large[1] / 2)
            row = _ends(side_x - obstruction.gap_m, (small, large), obstruction.gap_m)
            return [_car(size, end - size[0] / 2, y, 0.0) for size, end in row]
        case StandingAcross():
            # Their sides towards the target are in line.
            side = side_x - obstruction.before_m
            row = _ends(-obstruction.end_m, (large, small), obstruction.gap_m)
            return [
                _car(size, side - size[1] / 2, end - size[0] / 2, -np.pi / 2) for size, end in row
            ]
        case WaitingBeside():
            row = _ends(line_x - obstruction.before_m, (large, small, small), obstruction.gap_m)
            aside = obstruction.beside_m
            return [_car(size, end - size[0] / 2, -aside - size[1] / 2, 0.0) for size, end in row]
        case None:
            return []


def _ends(first: float, order: Sequence[Triple], gap: float) -> list[tuple[Triple, float]]:
    """Cars that stand one behind the other, and where the nearer end of each lies, from `first`
    downwards.
    """
    behind = np.cumsum([0.0, *(size[0] + gap for size in order[:-1])])
    return [(size, first - float(each)) for size, each in zip(order, behind, strict=True)]


def _car(size: Triple, x: float, y: float, heading: float) -> Car:
    return sized("obstructing car", "car", size), (x, y, heading)
