"""Which points lie on the road: a robust plane, held close to where the car's own stance says that
the road is.
"""

import numpy as np

from care_sim.core.arrays import Floats, Mask

STEEPEST = 0.03
"""The most by which the road may slope against the car's own plane: 1 degree of pitch, as under
hard braking, and the bend of a road over 50 m."""
SETTLING_M = 0.15
"""The most by which the road beneath may lie off the nominal height of the sensor: springs, and a
kerb climbed.
"""
ROUGHNESS_M = 0.05
"""Noise of ranges and unevenness; what lies much further off the plane has next to no vote."""
KERB_CLEARANCE_M = 0.25
"""Nothing lower than this above the plane is an object: a kerb (0.15 m) and twice the roughness."""


def heights_above(points: Floats, plane: Floats) -> Floats:
    """(P,) metres of points (P, 3) above the road `plane` (3,)."""
    return np.asarray(points[:, 2] - points[:, :2] @ plane[:2] - plane[2])


def road_plane(points: Floats, sensor_height_m: float) -> Floats:
    """(3,) a, b, c of the road z = a x + b y + c in the sensor frame.

    Least squares with Cauchy's loss over the points that could lie on the road; slope and offset
    are bounded, so few or misleading points do little, and none give the level plane beneath the
    sensor. The fit turns with the points.
    """
    level = np.array([0.0, 0.0, -sensor_height_m])
    low = points[_could_be_road(points, level)]
    if len(low) < len(level):
        return level

    # The free numbers are those of the bounded departure, so the fit needs no bounds of its own.
    design = np.column_stack([low[:, :2], np.ones(len(low))])

    def misses(free: Floats) -> Floats:
        return np.asarray(design @ (level + _bounded(free)[0]) - low[:, 2])

    def jacobian(free: Floats) -> Floats:

        return np.asarray(design @ _bounded(free)[1])

    from scipy.optimize import least_squares

    fit = least_squares(misses, np.zeros(3), jacobian, loss="cauchy", f_scale=ROUGHNESS_M)
    return level + _bounded(fit.x)[0]


def _bounded(free: Floats) -> tuple[Floats, Floats]:
    """(3,) a departure from the level plane, slope below STEEPEST whatever its direction and offset
    below SETTLING_M, from three free numbers; and its derivatives (3, 3).
    """
    departure = np.empty(3)
    derivatives = np.zeros((3, 3))
    # u / sqrt(1 + |u|^2) maps all vectors into the unit disc, alike in every direction.
    for part, most in ((slice(2), STEEPEST), (slice(2, 3), SETTLING_M)):
        u = free[part]
        scale = np.sqrt(1 + u @ u)
        departure[part] = most * u / scale
        derivatives[part, part] = most * (np.eye(len(u)) / scale - np.outer(u, u) / scale**3)
    return departure, derivatives


def _could_be_road(points: Floats, level: Floats) -> Mask:
    # As far off the level plane as the road may be at most at this range, and its roughness.
    reach = SETTLING_M + ROUGHNESS_M + STEEPEST * np.hypot(points[:, 0], points[:, 1])
    return np.asarray(np.abs(heights_above(points, level)) <= reach)
