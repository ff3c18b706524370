"""The traffic of a street with bends and side streets: a flow per lane, laid along its road."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.frames import Pose
from care_sim.world.lane_flow import LaneFlow


@dataclass(frozen=True)
class FlowingLane:
    """A lane and who drives in it.

    `poses_at` gives the world poses (n, 3) of places (n,) along the lane. `stop_m` is where its
    drivers give way, inf where they need not. The ego is in the lane while it is between
    `ego_from_m` and `ego_to_m` along its route, and its place is then `ego_ahead_m` farther.
    """

    flow: LaneFlow
    poses_at: Callable[[Floats], Floats]
    stop_m: float = np.inf
    ego_from_m: float = np.inf
    ego_to_m: float = np.inf
    ego_ahead_m: float = 0.0

    def others(self, ego_m: float, ego_speed: float) -> list[tuple[float, float]]:
        """Place and speed of what is in the lane besides its drivers, for an ego `ego_m` along its
        route.
        """
        found = [(self.stop_m, 0.0)] if np.isfinite(self.stop_m) else []
        if self.ego_from_m <= ego_m < self.ego_to_m:
            found.append((ego_m + self.ego_ahead_m, ego_speed))
        return found


class StreetTraffic:
    """All lanes of a street. Drivers follow whom they have ahead in their lane, the ego too."""

    def __init__(self, lanes: Sequence[FlowingLane]):
        self.lanes = tuple(lanes)
        self._poses = self._poses_now()

    def pose_at(self, lane: int, number: int, _time: float) -> Pose:
        """Return the world pose now of a vehicle, by the numbers of its lane and within it."""
        x, y, heading = self._poses[lane][number]
        return x, y, heading

    def step(self, dt: float, ego_m: float, ego_speed: float) -> None:
        """Move all by `dt` seconds, with the ego `ego_m` along its route."""
        for lane in self.lanes:
            lane.flow.step(dt, lane.others(ego_m, ego_speed))
        self._poses = self._poses_now()

    def _poses_now(self) -> list[list[list[float]]]:
        """World poses by lane and vehicle."""
        # Each is looked up alone: of plain lists that takes a third of the time.
        return [lane.poses_at(lane.flow.places).tolist() for lane in self.lanes]
