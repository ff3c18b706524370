"""The walls of a film: what hides those behind it, and what nobody annotated."""

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.loops.film import Film, Shot
from care_sim.sensors.annotated import NO_OBJECT

WALL_M = 0.5
"""Side of the squares in which walls are drawn: a scene has about a thousand."""
_WALL_FROM_M = 0.5
"""Over the road: what returns below is the ground or a kerb."""


def walls(film: Film) -> Floats:
    """(n, 2) the corners, in metres in the world, of all squares in which anything that nobody
    annotated returns at some keyframe.
    """
    squares = [np.floor(_standing(shot, film.sensor_height_m) / WALL_M) for shot in film.shots]
    corners: Floats = np.unique(np.concatenate(squares), axis=0) * WALL_M
    return corners


def _standing(shot: Shot, height_m: float) -> Floats:
    """(n, 2) world places of returns that are neither on an object nor on the ground."""
    points = shot.cloud.points[shot.cloud.objects == NO_OBJECT]
    # Over the road as the sensor stands on it: of a recording it may slope.
    points = points[points[:, 2] > _WALL_FROM_M - height_m]
    places: Floats = (shot.sensor.origin + shot.sensor.vectors_to_world(points))[:, :2]
    return places
