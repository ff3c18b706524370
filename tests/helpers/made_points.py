"""Bodies and roads made of points by hand, in the sensor frame."""

import numpy as np

from care_sim.core.frames import turned

HEIGHT = 1.84
"""Height of the sensor above the road, metres."""


def face(start, end, low, high, step=0.1):
    """Points on an upright face between two places x, y, from `low` to `high` metres above the
    road.
    """
    start, end = np.array(start, float), np.array(end, float)
    along = np.linspace(0, 1, max(2, round(np.hypot(*(end - start)) / step) + 1))
    places = start + along[:, None] * (end - start)
    heights = np.arange(low, high + 1e-9, 0.2) - HEIGHT
    return np.concatenate([np.column_stack([places, np.full(len(places), z)]) for z in heights])


def shell(x, y, yaw, length, width, height):
    """Points on the two upright faces of a box that a sensor at the origin sees."""
    corners = turned(
        0.5 * np.array([[length, width], [-length, width], [-length, -width], [length, -width]]),
        yaw,
    )
    corners += np.array([x, y])
    pairs = [(corners[i], corners[(i + 1) % 4]) for i in range(4)]
    shown = [(a, b) for a, b in pairs if a[0] * b[1] - a[1] * b[0] < 0]
    return np.concatenate([face(a, b, 0.3, height) for a, b in shown])


def road(reach=30, step=1.0, slope=0.0):
    """Points on the road around the car, rising towards x by `slope`."""
    x, y = np.meshgrid(np.arange(-reach, reach + step, step), np.arange(-reach, reach + step, step))
    points = np.column_stack([x.ravel(), y.ravel(), slope * x.ravel() - HEIGHT])
    return points[np.hypot(points[:, 0], points[:, 1]) > 3]
