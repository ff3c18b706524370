"""A frame of reference on the ground plane: where a car or a sensor is, and how it is turned."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Pose = tuple[float, float, float]
"""x, y (metres, world frame) and heading (radians, from x towards y) of a body on the ground."""


def turned(vectors: Floats, yaw: float | Floats) -> Floats:
    """Vectors (..., 2) or (..., 3) turned by `yaw` radians about z (one angle, or one a vector)."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    result: Floats = np.array(vectors, dtype=float)
    x, y = vectors[..., 0], vectors[..., 1]
    result[..., 0], result[..., 1] = cos * x - sin * y, sin * x + cos * y
    return result


_CORNERS = np.array([[x, y, z] for z in (-0.5, 0.5) for x, y in ((0.5, 0.5), (0.5, -0.5), (-0.5, -0.5), (-0.5, 0.5))])

BOX_EDGES = np.array([(a, b) for b in range(8) for a in range(b) if a + 4 == b or (a // 4 == b // 4 and (b - a) % 2)])
"""(12, 2) the edges of a box, as pairs of `box_corners`."""


def box_corners(boxes: Floats) -> Floats:
    """(n, 8, 3) corners of boxes (n, 7): four below, then the four above them."""
    return boxes[:, None, :3] + turned(_CORNERS * boxes[:, None, 3:6], boxes[:, 6:7])


@dataclass(frozen=True)
class Frame:
    """Origin (world x, y, z in metres) and heading `yaw` (radians) of a frame whose z axis is up."""

    x: float
    y: float
    z: float
    yaw: float

    @classmethod
    def mounted(cls, pose: Pose, at: tuple[float, float, float]) -> "Frame":
        """The frame of a sensor mounted `at` (x, y, z) in the frame of a body at `pose`."""
        x, y = turned(np.array(at[:2]), pose[2])
        return cls(pose[0] + float(x), pose[1] + float(y), at[2], pose[2])

    @property
    def origin(self) -> Floats:
        """(3,) world position."""
        return np.array([self.x, self.y, self.z])

    @property
    def _offset(self) -> Floats:
        return np.array([self.x, self.y, self.z, 0.0, 0.0, 0.0, self.yaw])

    def boxes_to_local(self, boxes: Floats) -> Floats:
        """World boxes (n, 7) seen in this frame."""
        return _moved(boxes - self._offset, -self.yaw)

    def boxes_to_world(self, boxes: Floats) -> Floats:
        """Boxes (n, 7) of this frame in the world."""
        return _moved(boxes, self.yaw) + self._offset


def _moved(boxes: Floats, yaw: float) -> Floats:
    return np.concatenate([turned(boxes[:, :3], yaw), boxes[:, 3:]], axis=1)
