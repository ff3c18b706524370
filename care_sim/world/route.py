"""Routes of a car: a sequence of straights and bends of constant curvature."""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from care_sim.base.checks import check_number
from care_sim.base.compiled import compiled
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers
from care_sim.core.frames import Pose

Leg = tuple[float, float]
"""Length in metres and curvature in 1/m, positive to the left; 0 is a straight."""

_SHARPEST_PER_M = 1.0
"""No road vehicle turns within a radius of a metre."""
_STRAIGHT_PER_M = 1e-12
"""Smaller curvatures count as straight: their radius may not be a number."""
_FAR_M = 1e6
"""Length of the straights before the first leg and after the last one, practically endless."""
_SLACK_M = 1e-3
"""More than rounding moves a bound of a distance."""


@dataclass(frozen=True)
class Route:
    """A line in the world that begins at the pose `start` and goes through `legs`.

    Places on it are `s`, metres along the line, and `d`, metres to its left. Before its start and
    after its last leg it goes on straight. Raises InvalidInput for a leg without length or with a
    bend that no road vehicle can drive.
    """

    start: Pose = (0.0, 0.0, 0.0)
    legs: tuple[Leg, ...] = ()

    def __post_init__(self) -> None:
        for length, curvature in self.legs:
            check_number("curvature of a leg", curvature, -_SHARPEST_PER_M, _SHARPEST_PER_M)
            if not 0 < length < _FAR_M:
                raise InvalidInput(f"length of a leg must be above 0 m, got {length!r}")

    @property
    def length(self) -> float:
        """Metres from the start to the end of the last leg."""
        return float(sum(length for length, _ in self.legs))

    def pose(self, s: float) -> Pose:
        """World pose of the line at `s`."""
        leg = self._leg(s)
        return _after(leg.start, s - leg.begins, leg.curvature)

    def curvature(self, s: float) -> float:
        """Curvature of the line at `s`, 1/m."""
        return self._leg(s).curvature

    def places(self, points: Floats) -> Floats:
        """(n, 3) `s`, `d` and the line's heading where it comes nearest to world points (n, 2)."""
        legs = self._columns
        squares, found, nearest, near = _on_straights(np.ascontiguousarray(points), legs)
        if len(near):
            # A bend's sines and cosines are NumPy's, of the few points that a bend may be near.
            (begins, lengths, curvatures), middles = legs.places[near[:, 1]].T, points[near[:, 0]]
            starts, (cos, sin) = legs.starts[near[:, 1]], legs.turns[near[:, 1]].T
            x, y = (middles - starts[:, :2]).T
            x, y = cos * x - sin * y, sin * x + cos * y
            along = x.copy()
            bends = np.abs(curvatures) >= _STRAIGHT_PER_M
            along[bends] = _along_arc(x[bends], y[bends], lengths[bends], curvatures[bends])
            along = np.clip(along, 0.0, lengths)
            heading = curvatures * along
            foot_x, foot_y = _chord(along, curvatures)
            off_x, off_y = x - foot_x, y - foot_y
            d = np.cos(heading) * off_y - np.sin(heading) * off_x
            on_bends = np.column_stack([begins + along, d, starts[:, 2] + heading])
            _take_nearer(squares, found, nearest, near, off_x**2 + off_y**2, on_bends)
        return np.asarray(found)

    def _leg(self, s: float) -> "_PlacedLeg":
        return self._legs[bisect_right(self._legs, s, key=lambda leg: leg.begins + leg.length)]

    @cached_property
    def _legs(self) -> tuple["_PlacedLeg", ...]:
        """Return the placed legs, with the straights before and after them."""
        poses, begins = [self.start], [0.0]
        for length, curvature in self.legs:
            poses.append(_after(poses[-1], length, curvature))
            begins.append(begins[-1] + length)
        before = _PlacedLeg(_after(self.start, -_FAR_M, 0.0), -_FAR_M, _FAR_M, 0.0)
        placed = [
            _PlacedLeg(pose, s, length, curvature)
            for pose, s, (length, curvature) in zip(poses, begins, self.legs, strict=False)
        ]
        return before, *placed, _PlacedLeg(poses[-1], begins[-1], np.inf, 0.0)

    @cached_property
    def _columns(self) -> "_Legs":
        legs = self._legs
        starts = np.array([leg.start for leg in legs])
        places = np.array([(leg.begins, leg.length, leg.curvature) for leg in legs])
        middles = [_after(leg.start, leg.length / 2, leg.curvature)[:2] for leg in legs[:-1]]
        turns = np.column_stack([np.cos(-starts[:, 2]), np.sin(-starts[:, 2])])
        return _Legs(starts, turns, places, np.array([*middles, (np.inf, np.inf)]))


class _Legs(NamedTuple):
    """All legs as rows. `starts` (legs, 3) are world poses, `middles` (legs, 2) world points.
    `turns` (legs, 2) are the cosine and sine that turn back by their headings. `places` (legs, 3)
    are the metres before each leg, its length and its curvature.
    """

    starts: Floats
    turns: Floats
    places: Floats
    middles: Floats


@compiled(brief=True)
def _on_straights(points: Floats, legs: _Legs) -> tuple[Floats, Floats, Integers, Integers]:
    """Return `Route.places` of points (n, 2) on the straight legs alone, after (n,) the squares of
    the distances and before (n,) the legs. The last table (k, 2) holds points and bends that may be
    as near.
    """
    # A place that is no number, or too far to be squared, has no place on the line.
    squares, found = np.full(len(points), np.inf), np.full((len(points), 3), np.nan)
    nearest = np.zeros(len(points), np.int64)
    near = np.empty((len(points) * len(legs.starts), 2), np.int64)
    count = 0
    for n in range(len(points)):
        for leg in range(len(legs.starts)):
            begins, length, curvature = legs.places[leg]
            if curvature != 0.0:
                continue
            left, up = points[n, 0] - legs.starts[leg, 0], points[n, 1] - legs.starts[leg, 1]
            cos, sin = legs.turns[leg]
            x, y = cos * left - sin * up, sin * left + cos * up
            along = min(max(x, 0.0), length)
            # Zero of either sign, which the sums keep.
            turn = curvature * along
            off_x, off_y = x - along, y - along * turn
            square = off_x * off_x + off_y * off_y
            if square < squares[n]:
                squares[n], nearest[n] = square, leg
                found[n] = begins + along, off_y - turn * off_x, legs.starts[leg, 2] + turn
        for leg in range(len(legs.starts)):
            # No point of a bend is farther from its middle than half of its length.
            x, y = points[n, 0] - legs.middles[leg, 0], points[n, 1] - legs.middles[leg, 1]
            reach = math.sqrt(squares[n]) + legs.places[leg, 1] / 2 + _SLACK_M
            if legs.places[leg, 2] != 0.0 and x * x + y * y <= reach * reach:
                near[count] = n, leg
                count += 1
    return squares, found, nearest, near[:count]


@compiled(brief=True)
def _take_nearer(
    squares: Floats,
    found: Floats,
    nearest: Integers,
    near: Integers,
    bend_squares: Floats,
    on_bends: Floats,
) -> None:
    """Take the places (k, 3) `on_bends` that are nearer than those `found`, as `_on_straights`
    returns them. Among equally near legs the first counts.
    """
    for k in range(len(near)):
        n, leg = near[k]
        is_first = bend_squares[k] == squares[n] and leg < nearest[n]
        if bend_squares[k] < squares[n] or is_first:
            squares[n], nearest[n], found[n] = bend_squares[k], leg, on_bends[k]


@dataclass(frozen=True)
class _PlacedLeg:
    """A leg that starts at a world pose, where the line is `begins` metres long."""

    start: Pose
    begins: float
    length: float
    curvature: float


def _along_arc(x: Floats, y: Floats, length: Floats, curvature: Floats) -> Floats:
    """Return the place of a point's foot on an arc that starts at the origin along x. The result is
    below 0 or above `length` where an end is nearer.
    """
    # Seen from the centre of the circle, a point's direction says how far along the arc its foot
    # is. Half a circle either way of the middle: beyond it the other end is nearer.
    radius = 1.0 / np.abs(curvature)
    turn = np.arctan2(x, radius - np.sign(curvature) * y)
    middle = length / radius / 2
    turn = middle + np.angle(np.exp(1j * (turn - middle)))
    return np.asarray(turn * radius)


def _chord(along: Floats | float, curvature: Floats | float) -> tuple[Floats, Floats]:
    """Return the point `along` metres down an arc that starts at the origin along x."""
    # NumPy's sinc(x) is sin(pi x) / (pi x) and 1 at 0, where the arc is straight.
    half = np.asarray(along) * curvature / 2
    chord = along * np.sinc(half / np.pi)
    return chord * np.cos(half), chord * np.sin(half)


def _after(start: Pose, along: float, curvature: float) -> Pose:
    # On a straight, by far the most frequent, the chord is the way itself.
    chord = _chord(along, curvature) if curvature else (along, 0.0)
    (x, y), cos, sin = chord, np.cos(start[2]), np.sin(start[2])
    there = float(start[0] + (cos * x - sin * y)), float(start[1] + (sin * x + cos * y))
    return *there, start[2] + curvature * along


def through(points: Sequence[tuple[float, float]], radius_m: float) -> Route:
    """Return the route along straight lines through `points` (at least two), with corners rounded
    to `radius_m`. Raises InvalidInput where the arcs of two corners would overlap.
    """
    corners = np.asarray(points, float)
    steps = np.diff(corners, axis=0)
    headings = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    # An arc that turns by t begins and ends radius * tan(t / 2) from its corner.
    turns = np.diff(headings)
    cuts = np.concatenate([[0.0], radius_m * np.tan(np.abs(turns) / 2), [0.0]])
    straights = np.hypot(*steps.T) - cuts[:-1] - cuts[1:]
    if np.any(straights < 0):
        raise InvalidInput(f"corners of a route are too close for bends of {radius_m} m")
    legs: list[Leg] = []
    for number, straight in enumerate(straights.tolist()):
        if straight > 0:
            legs.append((straight, 0.0))
        if number < len(turns) and turns[number] != 0.0:
            turn = float(turns[number])
            legs.append((abs(turn) * radius_m, float(np.sign(turn)) / radius_m))
    x, y = corners[0].tolist()
    return Route((x, y, float(headings[0])), tuple(legs))


class RouteCar:
    """The middle of the car is on the route, `along` metres from its start, and points along it."""

    along: float
    pose: Pose
    """x, y, heading."""
    speed: float
    """m/s along the route."""

    def __init__(self, route: Route, speed: float):
        self._route = route
        self.along = 0.0
        self.pose = route.pose(0.0)
        self.speed = speed

    @property
    def yaw_rate(self) -> float:
        """rad/s, above 0 to the left."""
        return self._route.curvature(self.along) * self.speed

    def accelerate(self, acceleration: float, dt: float) -> None:
        """Drive on for `dt` seconds with an acceleration (m/s^2); a car at rest does not reverse.

        As highway-env moves its vehicles, the step is driven at the speed it begins with.
        """
        self.along += self.speed * dt
        self.pose = self._route.pose(self.along)
        self.speed = max(self.speed + acceleration * dt, 0.0)


_SPACING_M = 0.25
"""Between two places at which the plan is worked out; a bend begins within it."""
_AS_PLANNED_MPS = 0.3
"""A car that lacks no more than this goes as planned: twice what it gains in 0.1 s. One that brakes
hard lacks more after one keyframe."""


@dataclass(frozen=True)
class SpeedPlan:
    """Planned speed: at most `cruise_mps`, and in a bend at most `sideways_mps2` of sideways
    acceleration. The car slows before a bend at `comfort_mps2` and accelerates after it at the same
    rate.
    """

    route: Route
    cruise_mps: float
    sideways_mps2: float
    comfort_mps2: float

    def at(self, s: float) -> float:
        """Return the planned speed at `s` metres along the route, m/s."""
        return float(np.interp(s, self._places, self._speeds))

    def seconds_to(self, here: float, there: float, speed: float, gaining: float) -> float:
        """Return the seconds from `here` to `there` for a car at `speed` m/s. The car gains speed
        by `gaining` m/s^2, 0 or more, where the plan allows it. A car at planned speed keeps to the
        plan. Returns 0 past `there`, inf for a car that stays at rest.
        """
        if there <= here:
            return 0.0
        # In a bend a car that goes as planned gains nothing, but will after it.
        if speed > self.at(here) - _AS_PLANNED_MPS:
            gaining = self.comfort_mps2
        places = np.linspace(here, there, max(int(np.ceil((there - here) / _SPACING_M)), 1) + 1)
        planned = np.interp(places, self._places, self._speeds)
        gained = np.sqrt(speed**2 + 2 * gaining * (places - here))
        return float(np.sum(_seconds_between(places, np.minimum(planned, gained))))

    def times(self, places: Floats) -> Floats:
        """Return (n,) the seconds from the first of the ascending `places` (n,) to each, driven as
        planned.
        """
        speeds = np.interp(places, self._places, self._speeds)
        return np.concatenate([[0.0], np.cumsum(_seconds_between(places, speeds))])

    @cached_property
    def _places(self) -> Floats:
        return np.arange(0.0, self.route.length + _SPACING_M, _SPACING_M)

    @cached_property
    def _speeds(self) -> Floats:
        bends = np.array([abs(self.route.curvature(s)) for s in self._places.tolist()])
        with np.errstate(divide="ignore"):
            speeds = np.minimum(self.cruise_mps, np.sqrt(self.sideways_mps2 / bends)).tolist()
        # v^2 grows by 2 a per metre: from each place on, and back from each.
        for here in range(1, len(speeds)):
            speeds[here] = min(speeds[here], self._reached(speeds[here - 1]))
        for here in range(len(speeds) - 2, -1, -1):
            speeds[here] = min(speeds[here], self._reached(speeds[here + 1]))
        return np.array(speeds)

    def _reached(self, speed: float) -> float:
        return math.sqrt(speed**2 + 2 * self.comfort_mps2 * _SPACING_M)


def _seconds_between(places: Floats, speeds: Floats) -> Floats:
    """(n - 1,) seconds from each of `places` (n,) to the next for a car that has `speeds` there."""
    # Even acceleration from place to place: the mean of two speeds is that of the way between.
    means = (speeds[1:] + speeds[:-1]) / 2
    with np.errstate(divide="ignore"):
        return np.asarray(np.diff(places) / means)
