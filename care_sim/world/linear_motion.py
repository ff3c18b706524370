"""How ego and bodies move about an instant: straight on at a constant speed, turning at a constant
rate.
"""

from dataclasses import dataclass, replace

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.frames import Frame, Pose, turned


@dataclass(frozen=True)
class LinearMotion:
    """The `ego` (x, y, heading) at an instant, its `ego_rates` (3,) and the `rates` (m, 3) of
    bodies by id: metres and radians per second, in the world.
    """

    ego: Pose
    ego_rates: Floats
    rates: Floats

    def poses(self, poses: Floats, seconds: float) -> Floats:
        """(m, 7) where bodies are `seconds` later that now stand at `poses` (m, 7: x, y, z,
        quaternion x, y, z, w).
        """
        moved = poses.copy()
        moved[:, :2] += self.rates[:, :2] * seconds
        # The product with the quaternion of a turn about the world's z, (0, 0, sin, cos) of half
        # the angle. Without a turn it changes no bit.
        half = self.rates[:, 2] * seconds / 2
        cos, sin = np.cos(half), np.sin(half)
        x, y, z, w = poses[:, 3:].T
        moved[:, 3:] = np.column_stack(
            [cos * x - sin * y, cos * y + sin * x, cos * z + sin * w, cos * w - sin * z]
        )
        return moved

    def sensor(self, sensor: Frame, seconds: float) -> Frame:
        """Where a frame that is fixed on the ego is `seconds` later."""
        ((x, y),) = self._carried(sensor, np.array([seconds])).tolist()
        return replace(sensor, x=x, y=y, yaw=sensor.yaw + float(self.ego_rates[2]) * seconds)

    def compensated(self, points: Floats, sensor: Frame, seconds: Floats) -> Floats:
        """(n, 3) in the frame `sensor` of now the `points` (n, 3) that were measured `seconds` (n,)
        later in the frame that it is then.
        """
        turns = self.ego_rates[2] * seconds
        world = turned(sensor.vectors_to_world(points), turns)
        world[:, :2] += self._carried(sensor, seconds) - sensor.origin[:2]
        return sensor.vectors_to_local(world)

    def _carried(self, sensor: Frame, seconds: Floats) -> Floats:
        """(n, 2) world places of the origin of a frame on the ego `seconds` (n,) later."""
        middle = np.array(self.ego[:2])
        levers = np.tile(sensor.origin[:2] - middle, (len(seconds), 1))
        driven = self.ego_rates[:2] * seconds[:, None]
        carried: Floats = middle + driven + turned(levers, self.ego_rates[2] * seconds)
        return carried


def rates_between(before: Floats, after: Floats, seconds: float) -> Floats:
    """(n, 3) rates that lead from poses (n, 3: x, y, heading) to others in `seconds`, turning the
    shorter way.
    """
    changes = after - before
    changes[:, 2] = np.remainder(changes[:, 2] + np.pi, 2 * np.pi) - np.pi
    rates: Floats = changes / seconds
    return rates
