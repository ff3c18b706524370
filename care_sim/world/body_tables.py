"""The bodies of a world as tables, a row per body: their boxes, and the parts that rays can hit.

Who asks about many bodies at once, such as a compiled engine, reads these instead of PyBullet.
"""

from collections.abc import Sequence

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.boxes import half_extents
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
        self._radii = np.empty(0)

    def add(self, body: int, size: Triple, pose: Pose) -> None:
        """Take in a body of a size on the ground plane."""
        # PyBullet numbers bodies upwards, the ground among them: rows between stay NaN.
        missing = body + 1 - len(self.boxes)
        self.boxes = np.vstack([self.boxes, np.full((missing, 7), np.nan)])
        self._radii = np.append(self._radii, np.full(missing, np.nan))
        self.boxes[body, 2:6] = size[2] / 2, *size
        self._radii[body] = np.hypot(*size[:2]) / 2
        self.move_all(np.array([body]), np.array([pose]))

    def move_all(self, bodies: Integers, poses: Floats) -> None:
        """Put bodies (n,) at poses (n, 3): x, y, heading."""
        self.boxes[bodies, :2] = poses[:, :2]
        self.boxes[bodies, 6] = poses[:, 2]

    def near(self, body: int, within: float) -> Integers:
        """Ids of the other bodies that may be within `within` metres of one. None of those is
        missing; some may be further away, since rectangles along x and y stand for the footprints.
        """
        # First by the circles that hold the footprints, which leave few for the rectangles. NaN,
        # where there is no body, is close to nothing.
        x, y = self.boxes[body, :2].tolist()
        apart = np.hypot(self.boxes[:, 0] - x, self.boxes[:, 1] - y)
        close = np.flatnonzero(apart <= self._radii + (self._radii[body] + within))
        if len(close) == 1:
            return close[close != body]
        half_x, half_y = half_extents(self.boxes[close])
        own = close == body
        gap_x = np.abs(self.boxes[close, 0] - x) - (half_x + half_x[own])
        gap_y = np.abs(self.boxes[close, 1] - y) - (half_y + half_y[own])
        return close[(gap_x <= within) & (gap_y <= within) & ~own]


class Primitives:
    """Every part of the opaque bodies of one world, and where the bodies are.

    `shapes` (k,) places in SHAPES, `halves` (k, 3) half extents and `offsets` (k, 3) centres of the
    parts in the body frame, metres; `owners` (k,) body ids. `poses` (m, 7), one row per body id: x,
    y, z in metres and the quaternion x, y, z, w, world frame.
    """

    def __init__(self) -> None:
        self.shapes = np.empty(0, np.int64)
        self.owners = np.empty(0, np.int64)
        self.halves = np.empty((0, 3))
        self.offsets = np.empty((0, 3))
        self.poses = np.empty((0, 7))

    def add(self, body: int, parts: Sequence[Part]) -> None:
        """Take in a body, its parts in its own frame; a body that nothing can hit has none."""
        self.poses = np.vstack([self.poses, np.zeros((body + 1 - len(self.poses), 7))])
        if parts:
            self.shapes = np.append(self.shapes, [SHAPES.index(part.shape) for part in parts])
            self.owners = np.append(self.owners, [body] * len(parts))
            self.halves = np.vstack([self.halves, np.array([part.size for part in parts]) / 2])
            self.offsets = np.vstack([self.offsets, [part.centre for part in parts]])
