"""A recorded car's own motion, from its poses."""

from collections.abc import Sequence

import numpy as np

from care_sim.frames import Floats, Frame
from care_sim.types import Ego


def motions(times_s: Floats, poses: Sequence[Frame]) -> list[Ego]:
    """The car's motion at every pose, by central differences: speed along its heading, yaw rate, acceleration.

    `times_s` (n,) ascend strictly. A single pose has no motion.
    """
    if len(poses) < 2:
        return [Ego() for _ in poses]
    yaws = np.array([pose.yaw for pose in poses])
    places = np.array([pose.origin[:2] for pose in poses])
    velocities = np.gradient(places, times_s, axis=0)
    speeds = velocities[:, 0] * np.cos(yaws) + velocities[:, 1] * np.sin(yaws)
    rates = np.gradient(np.unwrap(yaws), times_s), np.gradient(speeds, times_s)
    return [Ego(*values) for values in np.column_stack([speeds, *rates]).tolist()]
