"""From when on the ego sees who comes out, reckoned by lines of sight seen from above."""

from dataclasses import dataclass

import numpy as np

from care_sim.core.arrays import Floats, Mask
from care_sim.core.conditions import DriverSettings
from care_sim.core.frames import Pose, turned
from care_sim.perception.tracker import MemoryRules
from care_sim.streets.approach import Approach, Arrival
from care_sim.world.bodies import CATALOGUE
from care_sim.world.motions import Walk

SHOWN_M = 0.3
"""Of who comes out, what must stick out for three returns at 15 m, where columns are 0.18 m apart.
"""
HIDDEN_S = MemoryRules().coast_s
"""Nobody counts as hidden who was in sight within this time: the tracker holds a track as long."""
TRACKED_S = 0.2
"""Two keyframes, the second of which tells a velocity."""
CONTROLLER = DriverSettings()
EVERY_S = 0.2
"""Between two lines of sight that are kept: the ego moves by less than half of its length."""

Point = tuple[float, float]
"""World x and y."""


@dataclass(frozen=True)
class Sight:
    """Who comes is in sight for `seconds` before an ego that drives on is where it would hit them.

    `spare_s` of these are more than an ego needs that brakes at once. `lines` of sight go from the
    LiDAR to who comes. `yaws` says whether the ego's heading changes meanwhile.
    """

    seconds: float
    spare_s: float
    lines: tuple[tuple[Point, Point], ...]
    yaws: bool


def needed_s(speed: float) -> float:
    """Seconds that an ego at `speed` m/s needs to be seen in sight: until there is a track and the
    brake acts, and half of the time to stand, in which it drives what it would drive on.
    """
    return TRACKED_S + CONTROLLER.brake_reaction_s + speed / (2 * CONTROLLER.brake_mps2)


def sight_of(
    approach: Approach,
    arrival: Arrival,
    walk: Walk,
    length: float,
    occluder: str,
    pose: Pose,
    lead_s: float,
    hit_s: float,
) -> Sight | None:
    """How the ego sees who goes on a `walk`, `length` metres long, from behind an `occluder` at a
    `pose`; None where it does before, or without being hidden for HIDDEN_S.

    The walk begins `lead_s` before the arrival, and `hit_s` later it is where it would be hit.
    """
    since = approach.times - arrival.time_s + lead_s
    forward = np.array([np.cos(walk.heading), np.sin(walk.heading)])
    gone = np.zeros(len(since))
    gone[since > 0] = [walk.covered(walk.starts_s + time) for time in since[since > 0].tolist()]
    shown = walk.start + (gone[:, None] + length / 2 - SHOWN_M) * forward
    hidden = hides(pose, CATALOGUE[occluder].size[:2], approach.eyes, shown)

    before = np.flatnonzero(hidden & (since < hit_s))
    if not len(before) or since[before[-1] + 1] >= hit_s:
        return None
    first = int(before[-1]) + 1
    if not hidden[(since >= since[first] - HIDDEN_S) & (since < since[first])].all():
        return None
    ends = int(np.searchsorted(since, hit_s))
    seconds = hit_s - float(since[first])
    kept = np.searchsorted(since, np.arange(since[first], hit_s, EVERY_S))
    lines = tuple(
        (_point(eye), _point(front))
        for eye, front in zip(approach.eyes[kept], shown[kept], strict=True)
    )
    return Sight(
        seconds,
        seconds - needed_s(float(approach.speeds[first])),
        lines,
        bool(np.ptp(approach.poses[first:ends, 2]) > 0),
    )


def _point(place: Floats) -> Point:
    x, y = place.tolist()
    return x, y


def hides(body: Pose, size: tuple[float, float], eyes: Floats, points: Floats) -> Mask:
    """(n,) whether a rectangle at a pose, `size` long and wide, cuts the lines of sight from `eyes`
    (n, 2) to `points` (n, 2), seen from above.
    """
    # Slab test in the body's frame: a line is within the rectangle where it is within both its
    # length and its width.
    starts = turned(eyes - body[:2], -body[2])
    steps = turned(points - body[:2], -body[2]) - starts
    half = np.array(size) / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        edges = np.stack([(-half - starts) / steps, (half - starts) / steps])
    enters = np.maximum(edges.min(axis=0).max(axis=1), 0.0)
    leaves = np.minimum(edges.max(axis=0).min(axis=1), 1.0)
    return np.asarray(enters < leaves)
