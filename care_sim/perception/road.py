"""Which points lie on the road: a robust plane, held close to where the car's own stance says that the road is."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from care_sim.frames import Floats

STEEPEST = 0.03
"""The most by which the road may slope against the car's own plane: 1 degree of pitch, as under hard braking, and the
bend of a road over 50 m."""
SETTLING_M = 0.15
"""The most by which the road beneath may lie off the nominal height of the sensor: springs, and a kerb climbed."""
ROUGHNESS_M = 0.05
"""Noise of ranges and unevenness; what lies much further off the plane has next to no vote."""
ROAD_M = 0.25
"""Nothing lower than this above the plane is an object: a kerb (0.15 m) and twice the roughness."""


def heights_above(points: Floats, plane: Floats) -> Floats:
    """(P,) metres of points (P, 3) above the road `plane` (3,)."""
    return np.asarray(points[:, 2] - points[:, :2] @ plane[:2] - plane[2])


def road_plane(points: Floats, sensor_height_m: float) -> Floats:
    """(3,) a, b, c of the road z = a x + b y + c in the sensor frame.

    Least squares with Cauchy's loss over the points that could lie on the road; slope and offset are bounded, so
    few or misleading points do little, and none give the level plane beneath the sensor.
    """
    level = np.array([0.0, 0.0, -sensor_height_m])
    low = points[_could_be_road(points, level)]
    if len(low) < len(level):
        return level
    design = np.column_stack([low[:, :2], np.ones(len(low))])
    slack = np.array([STEEPEST, STEEPEST, SETTLING_M])

    def misses(plane: Floats) -> Floats:
        return np.asarray(design @ plane - low[:, 2])

    def jacobian(_: Floats) -> Floats:
        return design

    bounds = (level - slack, level + slack)
    fit = least_squares(misses, level, jacobian, bounds, loss="cauchy", f_scale=ROUGHNESS_M)
    return np.asarray(fit.x)


def _could_be_road(points: Floats, level: Floats) -> NDArray[np.bool_]:
    reach = SETTLING_M + ROUGHNESS_M + STEEPEST * np.hypot(points[:, 0], points[:, 1])
    return np.asarray(np.abs(heights_above(points, level)) <= reach)
