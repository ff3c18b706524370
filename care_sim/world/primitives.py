"""The bodies of a world as flat arrays: what a compiled engine reads without asking about each
body.
"""

from collections.abc import Sequence

import numpy as np

from care_sim.world.bodies import Part, Shape

SHAPES: tuple[Shape, ...] = ("box", "cylinder", "sphere")
"""Round parts stand along their own z; a shape's number is its place here."""


class Primitives:
    """Every part of the opaque bodies of one world, and where the bodies are.

    `shapes` (k,) places in SHAPES, `halves` (k, 3) half extents and `offsets` (k, 3) centres of the
    parts in the body frame, metres; `owners` (k,) body ids. `poses` (m, 7), one row a body id: x,
    y, z in metres and the quaternion x, y, z, w, world frame.
    """

    def __init__(self) -> None:
        self.shapes = np.empty(0, np.int64)
        self.owners = np.empty(0, np.int64)
        self.halves, self.offsets = np.empty((0, 3)), np.empty((0, 3))
        self.poses = np.empty((0, 7))

    def add(self, body: int, parts: Sequence[Part]) -> None:
        """Take in a body, its parts in its own frame; a body that nothing can hit has none."""
        self.poses = np.vstack([self.poses, np.zeros((body + 1 - len(self.poses), 7))])
        if parts:
            self.shapes = np.append(self.shapes, [SHAPES.index(part.shape) for part in parts])
            self.owners = np.append(self.owners, [body] * len(parts))
            self.halves = np.vstack([self.halves, np.array([part.size for part in parts]) / 2])
            self.offsets = np.vstack([self.offsets, [part.centre for part in parts]])
