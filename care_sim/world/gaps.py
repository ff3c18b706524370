"""What two bodies are apart at least, without asking PyBullet: bounds of its exact distances."""

import math

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers

PADDING_M = 0.05
"""PyBullet's distances may be this much less than those of the exact hulls; 2 mm were seen."""


@compiled()
def least_gap(box: Floats, other: Floats) -> float:
    """What two boxes (7,) on the ground are apart at least, metres; -inf where they may overlap."""
    # In the plane, and in the axes of the first: there an upright rectangle holds the other.
    dx, dy, turned = other[0] - box[0], other[1] - box[1], other[6] - box[6]
    cos, sin = math.cos(box[6]), math.sin(box[6])
    ahead, aside = cos * dx + sin * dy, cos * dy - sin * dx
    cos, sin = abs(math.cos(turned)), abs(math.sin(turned))
    along = abs(ahead) - (box[3] + other[3] * cos + other[4] * sin) / 2
    across = abs(aside) - (box[4] + other[3] * sin + other[4] * cos) / 2
    if along <= 0 and across <= 0:
        return -math.inf
    return math.hypot(max(along, 0.0), max(across, 0.0))


@compiled(brief=True)
def nearest_parts(own: Floats, other: Floats, poses: Floats) -> tuple[Floats, Integers]:
    """What the parts of two bodies are apart at least, metres, ascending, (n * m,); and which two
    each tells of: i * m + j is part i of n and part j of m. -inf where they may overlap.

    Of the parts the boxes are told, (n, 6) and (m, 6), centre and size in the frame of their body;
    the bodies stand at `poses` (2, 7) as in `care_sim.world.body_tables.Primitives.poses`.
    """
    boxes, others = _standing_parts(own, poses[0]), _standing_parts(other, poses[1])
    # A body that does not stand upright is in no such box.
    tilted = poses[0, 3] != 0 or poses[0, 4] != 0 or poses[1, 3] != 0 or poses[1, 4] != 0
    gaps = np.empty(len(boxes) * len(others))
    pairs = np.empty(len(gaps), np.int64)
    count = 0
    for i in range(len(boxes)):
        for j in range(len(others)):
            box, there = boxes[i], others[j]
            aside = max(least_gap(box, there), 0.0)
            above = max(abs(box[2] - there[2]) - (box[5] + there[5]) / 2, 0.0)
            apart = math.hypot(aside, above)
            gap = apart if apart > 0 and not tilted else -math.inf

            # Each takes its place among those before it: they are few.
            place = count
            while place and gaps[place - 1] > gap:
                gaps[place], pairs[place] = gaps[place - 1], pairs[place - 1]
                place -= 1
            gaps[place], pairs[place] = gap, count
            count += 1
    return gaps, pairs


@compiled()
def _standing_parts(parts: Floats, pose: Floats) -> Floats:
    """(n, 7) the boxes of the parts (n, 6) of an upright body, in the world frame."""
    boxes = np.empty((len(parts), 7))
    yaw = 2 * math.atan2(pose[5], pose[6])
    cos, sin = math.cos(yaw), math.sin(yaw)
    for n in range(len(boxes)):
        x, y = parts[n, 0], parts[n, 1]
        boxes[n, 0] = pose[0] + cos * x - sin * y
        boxes[n, 1] = pose[1] + sin * x + cos * y
        boxes[n, 2] = pose[2] + parts[n, 2]
        boxes[n, 3:6] = parts[n, 3:6]
        boxes[n, 6] = yaw
    return boxes
