"""A body that goes straight ahead at an even speed."""

from dataclasses import dataclass

import numpy as np

from care_sim.core.frames import Pose


@dataclass(frozen=True)
class StraightWay:
    """It is at `place` (x, y) at `time`, and goes along `heading` at `speed` before and after.

    Metres, seconds, radians, world frame.
    """

    place: tuple[float, float]
    heading: float
    speed: float
    time: float

    def pose(self, time: float) -> Pose:
        """Pose at `time`."""
        way = self.speed * (time - self.time)
        return (
            self.place[0] + way * float(np.cos(self.heading)),
            self.place[1] + way * float(np.sin(self.heading)),
            self.heading,
        )
