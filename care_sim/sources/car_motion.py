"""A recorded car's own motion, from where it was until now."""

from collections.abc import Sequence

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.frames import Frame
from care_sim.core.types import Ego

SPAN_S = 0.5
"""How far back the poses count: a keyframe. At 10 Hz these are six poses, which average out the
centimetres by which recorded poses err. Longer spans lag behind a driver who begins to brake."""
LEAST_POSES = 3
"""The fewest poses that tell a steady acceleration without lag. At 2 Hz they reach back a second.
"""


def motions(times_s: Floats, poses: Sequence[Frame]) -> list[Ego]:
    """Return the car's motion at every pose: speed along its heading, yaw rate, acceleration.

    Each motion is fitted to its pose and to earlier ones, never to later ones. Parabolas are fitted
    to places and headings of the last SPAN_S. `times_s` (n,) ascend strictly. The second pose has a
    speed and a yaw rate, but no acceleration. The first pose has no past, so its motion is zero.
    """
    # Headings that jump by a whole turn would be read as a spin.
    yaws = np.unwrap([pose.yaw for pose in poses])
    places = np.array([[pose.x, pose.y, yaw] for pose, yaw in zip(poses, yaws, strict=True)])
    return [_motion(times_s, places, pose) for pose in range(len(poses))]


def _motion(times_s: Floats, places: Floats, now: int) -> Ego:
    """Return the motion at row `now` of `places` (n, 3: x, y, heading)."""
    if now == 0:
        return Ego()
    # The span, 1% longer so that a pose at its very end counts whatever the clock's rounding; at
    # least LEAST_POSES, where there are so many.
    first = min(
        int(np.searchsorted(times_s, times_s[now] - 1.01 * SPAN_S)), max(now + 1 - LEAST_POSES, 0)
    )
    window = slice(first, now + 1)
    # Relative to now: the coefficients of the parabola are then place, rate and half the change of
    # the rate at this very moment.
    times = times_s[window] - times_s[now]
    degree = min(len(times), LEAST_POSES) - 1
    rates = np.polynomial.polynomial.polyfit(times, places[window] - places[now], degree)
    heading = np.array([np.cos(places[now, 2]), np.sin(places[now, 2])])
    acceleration = 2 * rates[2, :2] @ heading if degree == 2 else 0.0
    return Ego(float(rates[1, :2] @ heading), float(rates[1, 2]), float(acceleration))
