"""A person on foot: waits, then runs straight until the way is done."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.frames import Pose


@dataclass(frozen=True)
class Walk:
    """A straight walk from `start` (x, y) along `heading` for `length_m`, begun at `starts_s`.

    The person gains speed at `acceleration` until `speed`. Metres, seconds, radians, world frame.
    """

    start: tuple[float, float]
    heading: float
    speed: float
    acceleration: float
    length_m: float
    starts_s: float = 0.0

    def setting_off(self, time: float) -> "Walk":
        """The same walk, begun at `time`."""
        return replace(self, starts_s=time)

    def covered(self, time: float) -> float:
        """Metres covered at `time`."""
        # a t^2 / 2 while speed is gained, then evenly; nothing before the start or past the end.
        moving = max(time - self.starts_s, 0.0)
        gaining = min(moving, self.speed / self.acceleration)
        distance = self.acceleration * gaining**2 / 2 + self.speed * (moving - gaining)
        return min(distance, self.length_m)

    def duration_to(self, distance: float) -> float:
        """Seconds from setting off until `distance` metres are covered."""
        # While speed is gained, distance = acceleration * time^2 / 2; afterwards it grows evenly.
        run_up = self.speed**2 / (2 * self.acceleration)
        if distance <= run_up:
            return float(np.sqrt(2 * distance / self.acceleration))
        return self.speed / self.acceleration + (distance - run_up) / self.speed

    def pose(self, time: float) -> Pose:
        """Pose at `time`."""
        way = self.covered(time)
        cos, sin = self._direction
        return self.start[0] + way * cos, self.start[1] + way * sin, self.heading

    def poses(self, times: Floats) -> Floats:
        """(n, 3) the poses at `times` (n,): those of `pose`, to the last bit."""
        moving = np.maximum(times - self.starts_s, 0.0)
        gaining = np.minimum(moving, self.speed / self.acceleration)
        # The squares are Python's: NumPy's round otherwise.
        squares = np.array([time**2 for time in gaining.tolist()])
        distance = self.acceleration * squares / 2 + self.speed * (moving - gaining)
        way = np.minimum(distance, self.length_m)
        cos, sin = self._direction
        poses = np.empty((len(times), 3))
        poses[:, 0], poses[:, 1] = self.start[0] + way * cos, self.start[1] + way * sin
        poses[:, 2] = self.heading
        return poses

    @cached_property
    def _direction(self) -> tuple[float, float]:
        return float(np.cos(self.heading)), float(np.sin(self.heading))
