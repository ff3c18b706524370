"""Boxes against boxes and points, compiled."""

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers, Mask


@compiled()
def one_a_place(boxes: Floats) -> Mask:
    """(n,) which of boxes (n, 7), the surest first, stay: two bodies do not share a place, so of
    two of which one holds the other's centre in plan the surer stays.
    """
    kept = np.ones(len(boxes), np.bool_)
    for i in range(len(boxes)):
        for j in range(i):
            if kept[j] and (
                _holds(boxes[j], boxes[i, 0], boxes[i, 1])
                or _holds(boxes[i], boxes[j, 0], boxes[j, 1])
            ):
                kept[i] = False
                break
    return kept


@compiled()
def points_within(points: Floats, boxes: Floats) -> Integers:
    """(n,) how many of points (P, 3) lie in each of boxes (n, 7)."""
    counts = np.zeros(len(boxes), np.int64)
    for i in range(len(boxes)):
        cos, sin = np.cos(boxes[i, 6]), np.sin(boxes[i, 6])
        half_length, half_width, half_height = boxes[i, 3] / 2, boxes[i, 4] / 2, boxes[i, 5] / 2
        reach = np.hypot(half_length, half_width)
        for p in range(len(points)):
            dx = points[p, 0] - boxes[i, 0]
            # Most points are far from most boxes: one comparison sends them away.
            if abs(dx) > reach:
                continue
            dy, dz = points[p, 1] - boxes[i, 1], points[p, 2] - boxes[i, 2]
            along, across = cos * dx + sin * dy, cos * dy - sin * dx
            counts[i] += (
                abs(along) <= half_length and abs(across) <= half_width and abs(dz) <= half_height
            )
    return counts


@compiled()
def _holds(box: Floats, x: float, y: float) -> bool:
    dx, dy = x - box[0], y - box[1]
    cos, sin = np.cos(box[6]), np.sin(box[6])
    along, across = abs(cos * dx + sin * dy), abs(cos * dy - sin * dx)
    return bool(along <= box[3] / 2 and across <= box[4] / 2)
