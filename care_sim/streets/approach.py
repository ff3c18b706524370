"""How an ego that drives on as planned comes by somebody's line across the road: when its front is
there, where on the line it passes, and what it sees on the way.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from care_sim.core.arrays import Floats
from care_sim.core.frames import Pose, turned
from care_sim.core.sensor_setup import LIDAR_POSITION
from care_sim.world.bodies import CATALOGUE
from care_sim.world.route import SpeedPlan

EGO_LENGTH_M, EGO_WIDTH_M, _ = CATALOGUE["ego"].size
BEFORE_M = 50.0
"""Looked at before a line: the range of the first-sighting protocol."""
PAST_M = 12.0
"""Looked at behind it, until all of the ego is past a car that comes out."""
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
    """Somebody's way across a road, who comes from the `side` +1 (left) or -1 (right). `foot` is
    where it meets the road's reference line, headed as that.
    """

    foot: Pose
    side: int

    def local(self, points: Floats) -> Floats:
        """World points (..., 2) as metres ahead of the line, as the road leads, and towards the
        side.
        """
        return turned(points - self.foot[:2], -self.foot[2]) * (1, self.side)

    def point(self, ahead: float, aside: float) -> tuple[float, float]:
        """The world point `ahead` metres of the line and `aside` metres towards the side."""
        x, y = turned(np.array([ahead, self.side * aside]), self.foot[2]).tolist()
        return self.foot[0] + x, self.foot[1] + y


@dataclass(frozen=True)
class Arrival:
    """The ego's front has come to who goes along a line. `place_m` is the ego's middle along its
    route, `time_s` the approach's time, `at_m` where on the line the middle of its front is, metres
    towards the side, `reach_m` from where to where it takes up the line until it is past.
    """

    place_m: float
    time_s: float
    at_m: float
    reach_m: tuple[float, float]


@dataclass(frozen=True)
class Approach:
    """An ego that drives on as planned: `places` (n,) of its middle along its route, ascending,
    `times` (n,) from the first on, `speeds` (n,) in m/s and world `poses` (n, 3).
    """

    places: Floats
    times: Floats
    speeds: Floats
    poses: Floats

    @classmethod
    def along(cls, plan: SpeedPlan, from_m: float, to_m: float) -> "Approach":
        """The ego's way to lines that lie `from_m` to `to_m` along its route, and past them."""
        places = np.arange(max(from_m - BEFORE_M, 0.0), to_m + PAST_M, SPACING_M)
        speeds = np.array([plan.at(place) for place in places.tolist()])
        poses = np.array([plan.route.pose(place) for place in places.tolist()])
        return cls(places, plan.times(places), speeds, poses)

    def arrival(self, line: Line, half_width: float) -> Arrival:
        """When the front comes to a line on which who goes takes `half_width` to either side."""
        ahead, aside = line.local(_points((EGO_LENGTH_M / 2, 0.0), self.poses)).T
        # Before a turn the ego may be ahead of the line already: the last time it comes to it.
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
