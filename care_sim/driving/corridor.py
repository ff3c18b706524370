"""Tracks as they lie along the way that the car is to go."""

from dataclasses import replace

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Mask
from care_sim.core.boxes import half_extents
from care_sim.core.frames import Frame, turned
from care_sim.core.types import Tracks
from care_sim.world.route import Route

_NO_PACE_MPS = 1e-6
"""Who goes sideways no faster does not leave."""


def along_route(tracks: Tracks, route: Route, sensor: Frame) -> Tracks:
    """The tracks as they would lie before a car that drives straight ahead.

    x is metres along the route from where the sensor is, y metres to the left of the sensor's own
    line along it; headings and velocities are relative to the route where it comes nearest to the
    track. A track keeps its sizes and z.
    """
    if not len(tracks):
        return tracks
    boxes = sensor.boxes_to_world(tracks.boxes)
    own, *theirs = route.places(np.vstack([[sensor.x, sensor.y], boxes[:, :2]]))
    s, d, heading = np.array(theirs).T
    turn = heading - sensor.yaw
    straight: Floats = boxes.copy()
    straight[:, 0] = s - own[0]
    straight[:, 1] = d - own[1]
    straight[:, 2] = tracks.boxes[:, 2]
    straight[:, 6] = boxes[:, 6] - heading
    return replace(tracks, boxes=straight, velocities=turned(tracks.velocities, -turn))


def in_strip(ahead: Tracks, front_m: float, reach_m: float) -> Mask:
    """(n,) which tracks lie ahead of `front_m` within `reach_m` to either side of the way, now.

    Tracks as `along_route` gives them.
    """
    return enters_strip(ahead, front_m, reach_m, horizon_s=0.0)


def enters_strip(ahead: Tracks, front_m: float, reach_m: float, horizon_s: float) -> Mask:
    """(n,) which tracks lie ahead of `front_m` within `reach_m` to either side of the way, or will
    within `horizon_s` if they keep their velocities. Tracks as `along_route` gives them.
    """
    boxes = np.ascontiguousarray(ahead.boxes)
    # The sines and cosines are NumPy's, on every machine.
    turns = np.cos(boxes[:, 6]), np.sin(boxes[:, 6])
    velocities = np.ascontiguousarray(ahead.velocities)
    strip = float(front_m), float(reach_m), float(horizon_s)
    found: Mask = _enters(boxes, turns, velocities, strip)
    return found


@compiled()
def _enters(
    boxes: Floats,
    turns: tuple[Floats, Floats],
    velocities: Floats,
    strip: tuple[float, float, float],
) -> Mask:
    """See `enters_strip`. `turns` are cosines and sines (n,) of the headings; `strip` is where it
    begins, its reach to either side, and the horizon.
    """
    front_m, reach_m, horizon_s = strip
    found = np.empty(len(boxes), np.bool_)
    for n in range(len(boxes)):
        length, width = boxes[n, 3], boxes[n, 4]
        cos, sin = abs(turns[0][n]), abs(turns[1][n])
        half_x, half_y = (length * cos + width * sin) / 2, (length * sin + width * cos) / 2
        reach = reach_m + half_y
        # Sideways motion is even, so that a track is in the strip at some time of the horizon
        # exactly if the stretch between where it is now and where it is then meets the strip.
        now = boxes[n, 1]
        then = now + velocities[n, 1] * horizon_s
        found[n] = (
            boxes[n, 0] + half_x > front_m and min(now, then) <= reach and max(now, then) >= -reach
        )
    return found


def leaves_strip_s(ahead: Tracks, reach_m: float, horizon_s: float) -> Floats:
    """(n,) seconds until tracks that enter the strip have left it, if they keep their velocities;
    at most `horizon_s` after they have entered it. Of tracks that never enter it says nothing. The
    strip and the tracks are those of `enters_strip`.
    """
    _, half_y = half_extents(ahead.boxes)
    reach = reach_m + half_y
    sideways = ahead.velocities[:, 1]
    to_middle = -np.sign(sideways) * ahead.boxes[:, 1]
    pace = np.maximum(np.abs(sideways), _NO_PACE_MPS)
    enters_s = np.maximum(to_middle - reach, 0.0) / pace
    leaves: Floats = np.minimum((to_middle + reach) / pace, enters_s + horizon_s)
    return leaves
