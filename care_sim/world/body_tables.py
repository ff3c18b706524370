"""The bodies of a world as tables, a row per body: their boxes, and the parts that rays can hit.

Who asks about many bodies at once, such as a compiled engine, reads these instead of PyBullet.
"""

import math
from collections.abc import Sequence

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers
from care_sim.core.frames import Pose
from care_sim.world.bodies import Part, Shape, Triple

SHAPES: tuple[Shape, ...] = ("box", "cylinder", "sphere")
"""Round parts stand along their own z; a shape's number is its place here."""


class Footprints:
    """`boxes` (m, 7) in the world frame, one row per body id: centre x, y, z, length, width, height
    and yaw; NaN where there is no such body.
    """

    def __init__(self) -> None:
        self.boxes = np.empty((0, 7))

    def add(self, body: int, size: Triple, pose: Pose) -> None:
        """Take in a body of a size on the ground plane."""
        # PyBullet numbers bodies upwards, the ground among them: rows between stay NaN.
        missing = body + 1 - len(self.boxes)
        self.boxes = np.vstack([self.boxes, np.full((missing, 7), np.nan)])
        self.boxes[body, 2:6] = size[2] / 2, *size
        self.move_all(np.array([body]), np.array([pose], float))

    def move_all(self, bodies: Integers, poses: Floats) -> None:
        """Put bodies (n,) at poses (n, 3): x, y, heading."""
        _move(self.boxes, bodies, poses)

    def near(self, body: int, within: float) -> Integers:
        """Ids of the other bodies that may be within `within` metres of one. None of those is
        missing; some may be further away, since rectangles along x and y stand for the footprints.
        """
        return bodies_near(self.boxes, body, within)


@compiled()
def _move(boxes: Floats, bodies: Integers, poses: Floats) -> None:
    """See `Footprints.move_all`."""
    for n in range(len(bodies)):
        box = boxes[bodies[n]]
        box[0], box[1], box[6] = poses[n, 0], poses[n, 1], poses[n, 2]


@compiled()
def stand_at(
    table: Floats, bodies: Integers, poses: Floats, sines: Floats, cosines: Floats
) -> None:
    """Put bodies (n,) into the `table` (m, 7) of `Primitives.poses` at `poses` (n, 3), x, y,
    heading, on the ground. Sines and cosines (n,) are those of half the headings.
    """
    for n in range(len(bodies)):
        row = table[bodies[n]]
        row[0], row[1], row[2] = poses[n, 0], poses[n, 1], 0.0
        row[3], row[4], row[5], row[6] = 0.0, 0.0, sines[n], cosines[n]


@compiled()
def bodies_near(boxes: Floats, body: int, within: float) -> Integers:
    """See `Footprints.near`."""
    found = np.empty(len(boxes), np.int64)
    count = 0
    own = boxes[body]
    for other in range(len(boxes)):
        box = boxes[other]
        # First by the circles that hold the footprints, which leave few for the rectangles. NaN,
        # where there is no body, is close to nothing.
        apart = math.hypot(box[0] - own[0], box[1] - own[1])
        reach = (math.hypot(box[3], box[4]) + math.hypot(own[3], own[4])) / 2
        if other != body and apart <= reach + within and _rectangles_near(own, box, within):
            found[count] = other
            count += 1
    return found[:count]


@compiled()
def _rectangles_near(one: Floats, other: Floats, within: float) -> bool:
    """Whether rectangles along x and y around two footprints are within `within` metres."""
    half_x, half_y = 0.0, 0.0
    for box in (one, other):
        # The sides of a turned rectangle, each projected on the axis.
        cos, sin = abs(math.cos(box[6])), abs(math.sin(box[6]))
        half_x += (box[3] * cos + box[4] * sin) / 2
        half_y += (box[3] * sin + box[4] * cos) / 2
    gap_x, gap_y = abs(one[0] - other[0]) - half_x, abs(one[1] - other[1]) - half_y
    return bool(gap_x <= within and gap_y <= within)


class Primitives:
    """Every part of the opaque bodies of one world, and where the bodies are.

    `shapes` (k,) places in SHAPES, `halves` (k, 3) half extents and `offsets` (k, 3) centres of the
    parts in the body frame, metres; `owners` (k,) body ids, the parts of a body side by side;
    `materials` k names. `poses` (m, 7), one row per body id: x,
    y, z in metres and the quaternion x, y, z, w, world frame.
    """

    def __init__(self) -> None:
        self.shapes = np.empty(0, np.int64)
        self.owners = np.empty(0, np.int64)
        self.halves = np.empty((0, 3))
        self.offsets = np.empty((0, 3))
        self.materials: list[str] = []
        self.poses = np.empty((0, 7))

    def add(self, body: int, parts: Sequence[Part]) -> None:
        """Take in a body, its parts in its own frame; a body that nothing can hit has none."""
        self.poses = np.vstack([self.poses, np.zeros((body + 1 - len(self.poses), 7))])
        self.materials += [part.material for part in parts]
        if parts:
            self.shapes = np.append(self.shapes, [SHAPES.index(part.shape) for part in parts])
            self.owners = np.append(self.owners, [body] * len(parts))
            self.halves = np.vstack([self.halves, np.array([part.size for part in parts]) / 2])
            self.offsets = np.vstack([self.offsets, [part.centre for part in parts]])
