"""Tracks as they lie along the way that the car is to go."""

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Mask
from care_sim.core.frames import Frame, turned
from care_sim.core.types import Tracks
from care_sim.world.route import Route

_NO_PACE_MPS = 1e-6
"""Slower sideways motion does not count as leaving."""

Turns = tuple[Floats, Floats]
"""Cosines and sines (n,) of headings."""
Strip = tuple[float, float, float]
"""Where a strip begins, its reach to either side, and the horizon: metres and seconds."""
Footprint = tuple[float, float, float, float]
"""x and y of the middle of a box, and half of how far it reaches along x and along y; metres."""


def along_route(tracks: Tracks, route: Route, sensor: Frame) -> Tracks:
    """Return the tracks in the frame of the route, as if the car drove straight ahead. Here x is
    metres along the route from the sensor, and y metres to the left of the sensor's own line along
    the route. Headings and velocities are relative to the route at its nearest point to the track.
    Sizes and z stay.
    """
    if not len(tracks):
        return tracks
    boxes = sensor.boxes_to_world(tracks.boxes)
    points = np.empty((1 + len(boxes), 2))
    points[0], points[1:] = (sensor.x, sensor.y), boxes[:, :2]
    found = route.places(points)
    headings = found[1:, 2]
    rows = tracks.rows().copy()
    straight = rows[:, Tracks.BOX]
    straight[:, :2] = found[1:, :2] - found[0, :2]
    straight[:, 6] = boxes[:, 6] - headings
    rows[:, Tracks.VELOCITY] = turned(tracks.velocities, -(headings - sensor.yaw))
    return Tracks.from_checked_rows(rows)


def enters_strip(ahead: Tracks, front_m: float, reach_m: float, horizon_s: float = 0.0) -> Mask:
    """(n,) which tracks lie ahead of `front_m` within `reach_m` to either side of the way, or will
    within `horizon_s` if they keep their velocities. Tracks as `along_route` gives them.
    """
    boxes = np.ascontiguousarray(ahead.boxes)
    # The sines and cosines are NumPy's, on every machine.
    turns = np.cos(boxes[:, 6]), np.sin(boxes[:, 6])
    strip = float(front_m), float(reach_m), float(horizon_s)
    found: Mask = _all_enter(boxes, turns, np.ascontiguousarray(ahead.velocities), strip)
    return found


@compiled()
def _all_enter(boxes: Floats, turns: Turns, velocities: Floats, strip: Strip) -> Mask:
    """See `enters_strip`."""
    found = np.empty(len(boxes), np.bool_)
    for n in range(len(boxes)):
        box = boxes[n]
        of = footprint((box[0], box[1]), (box[3], box[4]), (turns[0][n], turns[1][n]))
        found[n] = enters(of, velocities[n, 1], strip)
    return found


@compiled()
def footprint(
    centre: tuple[float, float], size: tuple[float, float], turn: tuple[float, float]
) -> Footprint:
    """The footprint of a box with this `centre` x, y and length and width; `turn` is the cosine and
    the sine of its heading.
    """
    length, width = size
    # The sides of a turned rectangle, each projected on the axis.
    cos, sin = abs(turn[0]), abs(turn[1])
    return *centre, (length * cos + width * sin) / 2, (length * sin + width * cos) / 2


@compiled()
def enters(of: Footprint, sideways: float, strip: Strip) -> bool:
    """Whether a footprint that moves `sideways`, m/s, is in the strip now or will be."""
    x, now, half_x, half_y = of
    front_m, reach_m, horizon_s = strip
    reach = reach_m + half_y
    # Sideways motion is even, so that a track is in the strip at some time of the horizon exactly
    # if the stretch between where it is now and where it is then meets the strip.
    then = now + sideways * horizon_s
    return x + half_x > front_m and min(now, then) <= reach and max(now, then) >= -reach


@compiled(error_model="numpy")
def leaves_s(of: Footprint, sideways: float, strip: Strip) -> float:
    """Seconds until a footprint that moves `sideways`, m/s, and enters the strip has left it; at
    most the horizon after it has entered it. The value has no meaning for a footprint that never
    enters it.
    """
    _, y, _, half_y = of
    _, reach_m, horizon_s = strip
    reach = reach_m + half_y
    to_middle = -np.sign(sideways) * y
    pace = max(abs(sideways), _NO_PACE_MPS)
    enters_s = max(to_middle - reach, 0.0) / pace
    seconds: float = min((to_middle + reach) / pace, enters_s + horizon_s)
    return seconds
