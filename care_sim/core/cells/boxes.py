"""Boxes (n, 7): centre x, y, z, length, width, height, yaw; and the azimuths and elevations that
bound their hulls, which a dilated rectangle must hold.

The sensor frame is level, so that boxes in it stand upright, whatever the tilt of the grid. Where
the grid is tilted, the corners of the boxes are measured along its axes.
"""

import math

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Mask
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


Bounds = tuple[Floats, Floats, Mask]
"""(n, j) azimuths of every box, that of its centre first; (n, k) elevations; (n,) whether it stands
around the axis about which azimuths are counted, and so covers every column."""


def level_bounds(boxes: Floats) -> Bounds:
    """The bounds of boxes (n, 7) on a level grid."""
    # Angles are taken by NumPy here and not in the kernel: its arctangent differs from that of
    # compiled code in the last bits, and published cells were made with it.
    planar, upright, around = silhouettes(boxes)
    azimuths = np.arctan2(planar[..., 1], planar[..., 0])
    elevations = np.arctan2(upright[..., 0], upright[..., 1])
    return azimuths, elevations, around


def tilted_bounds(boxes: Floats, axes: Floats) -> Bounds:
    """The bounds of boxes (n, 7) on a grid whose forward, left and up are the rows of `axes` (3, 3)
    in the sensor frame.
    """
    # One product a box: that of all at once might round otherwise, by how many there are.
    centres = (boxes[:, None, :3] @ axes.T)[:, 0]
    return corner_bounds(centres, box_corners(boxes) @ axes.T)


def corner_bounds(centres: Floats, corners: Floats) -> Bounds:
    """The bounds of convex bodies with `corners` (n, 8, 3), joined as those of a box, and points
    `centres` (n, 3) in their midst, all along the axes of the grid.
    """
    points = np.concatenate([centres[:, None], corners], axis=1)
    azimuths = np.arctan2(points[..., 1], points[..., 0])

    # Around the axis the corners leave no gap of half a turn between neighbours.
    turns = np.sort(azimuths[:, 1:], axis=1)
    gaps = np.diff(turns, axis=1, append=turns[:, :1] + 2 * np.pi)
    around = gaps.max(axis=1) < np.pi

    # A face has its highest and lowest elevation on its edges, for only at the poles is the
    # elevation of a direction extreme. A box around the axis reaches the pole above or below.
    extremes = np.concatenate([corners, _extreme_points(corners)], axis=1)
    elevations = np.arctan2(extremes[..., 2], np.hypot(extremes[..., 0], extremes[..., 1]))
    levels = corners[..., 2]
    above = np.where(around & (levels.max(axis=1) > 0), np.pi / 2, elevations[:, 0])
    below = np.where(around & (levels.min(axis=1) < 0), -np.pi / 2, elevations[:, 0])
    return azimuths, np.column_stack([elevations, above, below]), around


def _extreme_points(corners: Floats) -> Floats:
    """(n, 12, 3) the point of every edge of boxes with `corners` (n, 8, 3) at which its elevation
    is extreme, or the end that is nearest to it.
    """
    starts, ends = corners[:, BOX_EDGES[:, 0]], corners[:, BOX_EDGES[:, 1]]
    ways = ends - starts
    # At the share t of the way, z / hypot(x, y) is extreme where its derivative is 0. The terms
    # with t^2 cancel out, so that there is one such t.
    z, rise = starts[..., 2], ways[..., 2]
    along = (starts * ways)[..., :2].sum(axis=-1)
    beyond = rise * along - z * (ways[..., :2] ** 2).sum(axis=-1)
    behind = z * along - rise * (starts[..., :2] ** 2).sum(axis=-1)
    shares = np.divide(behind, beyond, out=np.zeros_like(z), where=beyond != 0)
    points: Floats = starts + np.clip(shares, 0.0, 1.0)[..., None] * ways
    return points


@compiled()
def silhouettes(boxes: Floats) -> tuple[Floats, Floats, Mask]:
    """What of boxes (n, 7) bounds their hulls, seen from the origin, and which of them surround it.

    Returns x and y (n, 5, 2) of the centre and the four corners. Then (n, 2, 2) the heights of
    bottom and top, each with the distance in the x, y plane at which it appears lowest or highest.
    Then (n,) whether a box stands around the origin.
    """
    planar = np.empty((len(boxes), 5, 2))
    upright = np.empty((len(boxes), 2, 2))
    around = np.empty(len(boxes), np.bool_)

    for n, (x, y, z, length, width, height, yaw) in enumerate(boxes):
        # How far the origin lies beyond the sides, in the axes of the box. Negative means between
        # two sides and counts as 0. So the distance to the nearest point of the footprint follows,
        # and it is 0 for an origin inside.
        cos, sin = math.cos(yaw), math.sin(yaw)
        beyond = abs(cos * x + sin * y) - length / 2, abs(sin * x - cos * y) - width / 2
        near = math.hypot(max(beyond[0], 0.0), max(beyond[1], 0.0))

        # Seen from outside, a rectangle spans the directions between two of its corners. Its
        # farthest point is a corner, too, since distance is a convex function. The centre goes
        # first, as the direction that all are compared with.
        far = 0.0
        planar[n, 0] = x, y
        for k, (front, left) in enumerate(((0.5, 0.5), (0.5, -0.5), (-0.5, -0.5), (-0.5, 0.5))):
            along, across = front * length, left * width
            corner = x + (cos * along - sin * across), y + (sin * along + cos * across)
            planar[n, k + 1] = corner
            far = max(far, math.hypot(corner[0], corner[1]))

        # A bottom below the horizon appears lowest where it is nearest, one above it where it is
        # farthest; a top the other way round.
        bottom, top = z - height / 2, z + height / 2
        upright[n, 0] = bottom, near if bottom < 0 else far
        upright[n, 1] = top, near if top > 0 else far
        around[n] = near <= 0.0
    return planar, upright, around
