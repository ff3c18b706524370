"""Arrival and sight of an ego that drives on as planned at a comer's line across the road. Computes
when its front is there, where on the line it passes, and from when on it sees the comer, by lines
of sight from above.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from care_sim.core.arrays import Floats, Mask
from care_sim.core.conditions import DriverSettings
from care_sim.core.frames import Pose, turned
from care_sim.core.sensor_setup import LIDAR_POSITION
from care_sim.perception.tracker import MemoryRules
from care_sim.world.bodies import CATALOGUE
from care_sim.world.motions import Walk
from care_sim.world.route import SpeedPlan

EGO_LENGTH_M, EGO_WIDTH_M, _ = CATALOGUE["ego"].size
BEFORE_M = 50.0
"""Distance before a line that is examined: the range of the first-sighting protocol."""
PAST_M = 12.0
"""Distance behind the line that is examined, until the whole ego is past a car that comes out."""
SPACING_M = 0.25
_OUTLINE: Floats = np.array(
    [
        (along * EGO_LENGTH_M, side * EGO_WIDTH_M)
        for along in (-0.5, 0.0, 0.5)
        for side in (-0.5, 0.5)
    ]
)
"""(6, 2) corners and the middles of both sides, in the ego's frame: in a turn the front corner goes
outermost, and the side's middle innermost.
"""


@dataclass(frozen=True)
class Line:
    """A comer's way across a road, from the `side` +1 (left) or -1 (right). `foot` is its
    intersection with the road's reference line, with the line's heading.
    """

    foot: Pose
    side: int

    def local(self, points: Floats) -> Floats:
        """Return world points (..., 2) as metres ahead of the line, along the road, and towards the
        side.
        """
        return turned(points - self.foot[:2], -self.foot[2]) * (1, self.side)

    def point(self, ahead: float, aside: float) -> tuple[float, float]:
        """The world point `ahead` metres of the line and `aside` metres towards the side."""
        x, y = turned(np.array([ahead, self.side * aside]), self.foot[2]).tolist()
        return self.foot[0] + x, self.foot[1] + y


@dataclass(frozen=True)
class Arrival:
    """The ego's front at a comer's line. `place_m` is the ego's middle along its route, `time_s`
    the approach's time. `at_m` is the middle of its front on the line, metres towards the side.
    `reach_m` are the ends of the part of the line that the ego covers until it is past.
    """

    place_m: float
    time_s: float
    at_m: float
    reach_m: tuple[float, float]


@dataclass(frozen=True)
class Approach:
    """An ego that drives on as planned. `places` (n,) of its middle along its route ascend, `times`
    (n,) count from the first. `speeds` (n,) are m/s, `poses` (n, 3) in the world.
    """

    places: Floats
    times: Floats
    speeds: Floats
    poses: Floats

    @classmethod
    def along(cls, plan: SpeedPlan, from_m: float, to_m: float) -> "Approach":
        """Return the ego's way to lines `from_m` to `to_m` along its route, and past them."""
        places = np.arange(max(from_m - BEFORE_M, 0.0), to_m + PAST_M, SPACING_M)
        speeds = np.array([plan.at(place) for place in places.tolist()])
        poses = np.array([plan.route.pose(place) for place in places.tolist()])
        return cls(places, plan.times(places), speeds, poses)

    def arrival(self, line: Line, half_width: float) -> Arrival:
        """Return the arrival of the front at a line whose comer covers `half_width` to either
        side.
        """
        ahead, aside = line.local(_points((EGO_LENGTH_M / 2, 0.0), self.poses)).T
        # Before a turn the ego may already be ahead of the line: take its last arrival.
        last = int(np.flatnonzero(ahead < -half_width)[-1])
        share = (-half_width - ahead[last]) / (ahead[last + 1] - ahead[last])
        place, time, at = (
            float(values[last] + share * (values[last + 1] - values[last]))
            for values in (self.places, self.times, aside)
        )
        passing = line.local(_points(_OUTLINE, self.poses[last:])).reshape(-1, 2)
        taken = passing[np.abs(passing[:, 0]) <= half_width + SPACING_M, 1]
        return Arrival(place, time, at, (float(taken.min()), float(taken.max())))

    @cached_property
    def eyes(self) -> Floats:
        """(n, 2) world places of the LiDAR."""
        return _points(LIDAR_POSITION[:2], self.poses)


def _points(on_ego: ArrayLike, poses: Floats) -> Floats:
    """(..., n, 2) world places of points (..., 2) in the ego's frame when it is at poses (n, 3)."""
    points = np.asarray(on_ego, dtype=float)[..., None, :]
    each = np.broadcast_to(points, (*points.shape[:-2], len(poses), 2))
    return np.asarray(poses[:, :2] + turned(each, poses[:, 2]))


SHOWN_M = 0.3
"""Visible width of a comer for three returns at 15 m, where columns are 0.18 m apart."""
HIDDEN_S = MemoryRules().coast_s
"""A comer in sight within this time is not hidden: the tracker keeps a track as long."""
TRACKED_S = 0.2
"""Two keyframes, the second of which gives a velocity."""
CONTROLLER = DriverSettings()
EVERY_S = 0.2
"""Time between stored lines of sight, in which the ego moves by less than half of its length."""

Point = tuple[float, float]
"""World x and y."""


@dataclass(frozen=True)
class Sight:
    """Time in sight: the comer is in sight for `seconds` before an ego that drives on would hit the
    comer.

    `spare_s` of these exceed the need of an ego that brakes at once. `lines` of sight go from the
    LiDAR to the comer. `yaws` is True if the ego's heading changes meanwhile.
    """

    seconds: float
    spare_s: float
    lines: tuple[tuple[Point, Point], ...]
    yaws: bool


def needed_s(speed: float) -> float:
    """Return the seconds in sight that an ego at `speed` m/s needs: until there is a track and the
    brake acts, plus half of the time to stop.
    """
    return TRACKED_S + CONTROLLER.brake_reaction_s + speed / (2 * CONTROLLER.brake_mps2)


def sight_of(
    approach: Approach,
    arrival: Arrival,
    walk: Walk,
    length: float,
    occluder: str,
    pose: Pose,
    lead_s: float,
    hit_s: float,
) -> Sight | None:
    """Return the ego's sight of a comer on a `walk`, `length` metres long, from behind an
    `occluder` at a `pose`. None if the comer is visible before, or not hidden for HIDDEN_S.

    The walk begins `lead_s` before the arrival; `hit_s` later the comer is at the impact point.
    """
    since = approach.times - arrival.time_s + lead_s
    forward = np.array([np.cos(walk.heading), np.sin(walk.heading)])
    gone = np.zeros(len(since))
    gone[since > 0] = [walk.covered(walk.starts_s + time) for time in since[since > 0].tolist()]
    shown = walk.start + (gone[:, None] + length / 2 - SHOWN_M) * forward
    hidden = hides(pose, CATALOGUE[occluder].size[:2], approach.eyes, shown)

    before = np.flatnonzero(hidden & (since < hit_s))
    if not len(before) or since[before[-1] + 1] >= hit_s:
        return None
    first = int(before[-1]) + 1
    if not hidden[(since >= since[first] - HIDDEN_S) & (since < since[first])].all():
        return None
    ends = int(np.searchsorted(since, hit_s))
    seconds = hit_s - float(since[first])
    kept = np.searchsorted(since, np.arange(since[first], hit_s, EVERY_S))
    lines = tuple(
        (_point(eye), _point(front))
        for eye, front in zip(approach.eyes[kept], shown[kept], strict=True)
    )
    return Sight(
        seconds,
        seconds - needed_s(float(approach.speeds[first])),
        lines,
        bool(np.ptp(approach.poses[first:ends, 2]) > 0),
    )


def _point(place: Floats) -> Point:
    x, y = place.tolist()
    return x, y


def hides(body: Pose, size: tuple[float, float], eyes: Floats, points: Floats) -> Mask:
    """Return (n,) whether a rectangle at a pose, `size` long and wide, cuts the lines of sight from
    `eyes` (n, 2) to `points` (n, 2), seen from above.
    """
    # Slab test in the body's frame: a line is within the rectangle where it is within both its
    # length and its width.
    starts = turned(eyes - body[:2], -body[2])
    steps = turned(points - body[:2], -body[2]) - starts
    half = np.array(size) / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        edges = np.stack([(-half - starts) / steps, (half - starts) / steps])
    enters = np.maximum(edges.min(axis=0).max(axis=1), 0.0)
    leaves = np.minimum(edges.max(axis=0).min(axis=1), 1.0)
    return np.asarray(enters < leaves)
