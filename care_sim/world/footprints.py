"""The boxes of the bodies of a world, and which of them can be close to each other."""

import numpy as np

from care_sim.core.frames import Floats, Integers, Pose
from care_sim.world.bodies import Triple


class Footprints:
    """`boxes` (m, 7) in the world frame, one row a body id; NaN where there is no such body."""

    def __init__(self) -> None:
        self.boxes = np.empty((0, 7))
        self._halves = np.empty((0, 2))

    def add(self, body: int, size: Triple, pose: Pose) -> None:
        """Take in a body of a size on the ground plane."""
        missing = body + 1 - len(self.boxes)
        self.boxes = np.vstack([self.boxes, np.full((missing, 7), np.nan)])
        self._halves = np.vstack([self._halves, np.full((missing, 2), np.nan)])
        self.boxes[body, 2:6] = size[2] / 2, *size
        self.move_all(np.array([body]), np.array([pose]))

    def move_all(self, bodies: Integers, poses: Floats) -> None:
        """Put bodies (n,) at poses (n, 3): x, y, heading."""
        boxes = self.boxes[bodies]
        boxes[:, :2], boxes[:, 6] = poses[:, :2], poses[:, 2]
        self.boxes[bodies] = boxes
        (length, width), cos, sin = (
            boxes[:, 3:5].T,
            np.abs(np.cos(poses[:, 2])),
            np.abs(np.sin(poses[:, 2])),
        )
        self._halves[bodies] = (
            np.stack([length * cos + width * sin, length * sin + width * cos], axis=1) / 2
        )

    def near(self, body: int, within: float) -> Integers:
        """Ids of the other bodies that may be within `within` metres of one: all but those further
        from it by the rectangles, along x and y, around the footprints.
        """
        gaps = np.abs(self.boxes[:, :2] - self.boxes[body, :2]) - (
            self._halves + self._halves[body]
        )
        close = (gaps[:, 0] <= within) & (gaps[:, 1] <= within)
        close[body] = False
        return np.flatnonzero(close)
