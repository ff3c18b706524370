"""A vehicle that changes lanes on a straight path, at even speeds along and across."""

from dataclasses import dataclass

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.frames import Pose


@dataclass(frozen=True)
class LaneChange:
    """Drives along x at `speed_mps` from `start` (x, y) at time 0, and from `begins_s` on across at
    `lateral_mps` until it is at `to_y`. Metres, seconds, world frame.

    It keeps its heading, as the cut-ins of UN Regulation 157 do: their distances are measured
    between boxes along the road.
    """

    start: tuple[float, float]
    speed_mps: float
    begins_s: float
    lateral_mps: float
    to_y: float

    def pose(self, time: float) -> Pose:
        """Pose at `time`."""
        x, y = self.start
        way = self.to_y - y
        moved = min(self.lateral_mps * max(time - self.begins_s, 0.0), abs(way))
        return x + self.speed_mps * time, y + (moved if way > 0 else -moved), 0.0

    def poses(self, times: Floats) -> Floats:
        """(n, 3) the poses at `times` (n,): those of `pose`, to the last bit."""
        x, y = self.start
        way = self.to_y - y
        moved = np.minimum(self.lateral_mps * np.maximum(times - self.begins_s, 0.0), abs(way))
        poses = np.zeros((len(times), 3))
        poses[:, 0], poses[:, 1] = x + self.speed_mps * times, y + (moved if way > 0 else -moved)
        return poses
