"""Tracks as they lie along the way that the car is to go."""

from dataclasses import replace

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.frames import Frame, turned
from care_sim.core.types import Tracks
from care_sim.world.route import Route


def along_route(tracks: Tracks, route: Route, sensor: Frame) -> Tracks:
    """The tracks as they would lie before a car that drives straight ahead.

    x is metres along the route from where the sensor is, y metres to the route's left; headings and
    velocities are relative to the route where it comes nearest to the track. A track keeps its
    sizes and z.
    """
    if not len(tracks):
        return tracks
    own = route.places(np.array([[sensor.x, sensor.y]]))[0]
    boxes = sensor.boxes_to_world(tracks.boxes)
    s, d, heading = route.places(boxes[:, :2]).T
    turn = heading - sensor.yaw
    straight: Floats = boxes.copy()
    straight[:, 0] = s - own[0]
    straight[:, 1] = d - own[1]
    straight[:, 2] = tracks.boxes[:, 2]
    straight[:, 6] = boxes[:, 6] - heading
    return replace(tracks, boxes=straight, velocities=turned(tracks.velocities, -turn))
