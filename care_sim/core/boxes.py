"""What follows from boxes (n, 7): centre x, y, z, length, width, height, yaw."""

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.frames import turned

_AROUND = ((0.5, 0.5), (0.5, -0.5), (-0.5, -0.5), (-0.5, 0.5))
_CORNERS = np.array([[x, y, z] for z in (-0.5, 0.5) for x, y in _AROUND])

# A corner is joined to the one above it, and to the next and the one before in its own square of
# four: their numbers there differ by 1 or 3.
BOX_EDGES = np.array(
    [(a, b) for b in range(8) for a in range(b) if a + 4 == b or (a // 4 == b // 4 and (b - a) % 2)]
)
"""(12, 2) the edges of a box, as pairs of `box_corners`."""


def box_corners(boxes: Floats) -> Floats:
    """(n, 8, 3) corners of boxes (n, 7): four below, then the four above them."""
    return boxes[:, None, :3] + turned(_CORNERS * boxes[:, None, 3:6], boxes[:, 6:7])


def planar_ranges(boxes: Floats) -> Floats:
    """(n,) distances of the centres from the origin in the x, y plane."""
    ranges: Floats = np.hypot(boxes[:, 0], boxes[:, 1])
    return ranges


def half_extents(boxes: Floats) -> tuple[Floats, Floats]:
    """(n,) half of how far every box reaches along x, and (n,) along y."""
    length, width, yaw = boxes[:, 3], boxes[:, 4], boxes[:, 6]
    # The sides of a turned rectangle, each projected on the axis.
    cos, sin = np.abs(np.cos(yaw)), np.abs(np.sin(yaw))
    return (length * cos + width * sin) / 2, (length * sin + width * cos) / 2
