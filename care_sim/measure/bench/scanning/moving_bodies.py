"""Bodies for the measures of scans: seeded, all around the sensor, all of them moving."""

from dataclasses import dataclass

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.frames import Frame
from care_sim.core.sensor_setup import LIDAR_POSITION
from care_sim.core.types import CLASSES
from care_sim.world.bodies import CATALOGUE, BodyKind

NEAREST_BODY_M = 8.0
"""No bus, which is 11 m long, reaches the sensor."""
_FARTHEST_M = 48.0
"""Every body lies within the reach of 50 m."""
SWAY_M = 0.8
"""How far bodies move from scan to scan at most: 8 m/s over 0.1 s."""

SENSOR = Frame(0.0, 0.0, LIDAR_POSITION[2], 0.0)


@dataclass(frozen=True)
class MovingBodies:
    """`kinds` of the n bodies and where they stand on average: `poses` (n, 3) as x, y and
    heading.
    """

    kinds: tuple[BodyKind, ...]
    poses: Floats

    def at(self, number: float) -> Floats:
        """(n, 3) poses at a scan: every body sways along its heading."""
        shift = SWAY_M * np.sin(number + 1)
        heading = self.poses[:, 2]
        moved = self.poses.copy()
        moved[:, :2] += shift * np.column_stack([np.cos(heading), np.sin(heading)])
        return moved


def moving_bodies(bodies: int, seed: int) -> MovingBodies:
    """Bodies of the five classes in turn, evenly spread over the ring around the sensor."""
    rng = np.random.default_rng(seed)
    # Uniform in the square of the distance is uniform in area.
    distance = np.sqrt(rng.uniform(NEAREST_BODY_M**2, _FARTHEST_M**2, bodies))
    bearing, heading = rng.uniform(-np.pi, np.pi, (2, bodies))
    kinds = tuple(CATALOGUE[CLASSES[number % len(CLASSES)]] for number in range(bodies))
    x = distance * np.cos(bearing)
    y = distance * np.sin(bearing)
    return MovingBodies(kinds, np.column_stack([x, y, heading]))
