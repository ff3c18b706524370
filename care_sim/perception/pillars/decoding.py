"""Decode the network's output to boxes: find peaks, read their boxes, keep one body per place."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.types import CLASSES
from care_sim.perception.pillars.network import cell_centres


@compiled()
def drop_overlaps(boxes: Floats) -> Mask:
    """Return (n,) which of boxes (n, 7), the surest first, stay. Two bodies do not share a place:
    if a box holds another's centre in plan, the surer one stays.
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
    """Return (n,) the number of points (P, 3) in each of boxes (n, 7)."""
    counts = np.zeros(len(boxes), np.int64)
    for i in range(len(boxes)):
        cos, sin = np.cos(boxes[i, 6]), np.sin(boxes[i, 6])
        half_length, half_width, half_height = boxes[i, 3] / 2, boxes[i, 4] / 2, boxes[i, 5] / 2
        reach = np.hypot(half_length, half_width)
        for p in range(len(points)):
            dx = points[p, 0] - boxes[i, 0]
            # Most points are far from most boxes: one comparison excludes them.
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


MOST_PEAKS = 300
"""Number of peaks used, the surest first; a street has 30 objects in range."""
SMALLEST_M, LARGEST_M = 0.2, 25.0
"""Bounds of a length, a width or a height."""


class Peaks(NamedTuple):
    """Peaks of classes: cells where a class is likelier than in the eight cells around, the surest
    first. `classes` (n,), the network's `logits` (n,), `scores` (n,) from 0 to 1, `boxes` (n, 7) in
    the sensor frame.
    """

    classes: Integers
    logits: Floats
    scores: Floats
    boxes: Floats

    def take(self, rows: Integers | Mask) -> "Peaks":
        """Some of them."""
        return Peaks(self.classes[rows], self.logits[rows], self.scores[rows], self.boxes[rows])


def peaks_of(
    answer: NDArray[np.float32], sensor_height_m: float, calibration: Floats, least_score: float
) -> Peaks:
    """Return the peaks of a network's output (OUTPUTS, CELLS, CELLS) with scores of `least_score`
    or more, one per place (`care_sim.perception.pillars.network`).

    `calibration` (classes, 2) holds slopes and offsets from logits to those of scores.
    """
    sure = answer[: len(CLASSES)]
    classes, rows, columns = np.nonzero(sure == _highest_around(sure))
    logits = sure[classes, rows, columns].astype(np.float64)
    scores = score(calibration, classes, logits)

    # Stable, so that equally sure peaks stay in the order of classes and cells.
    order = np.argsort(-scores, kind="stable")[:MOST_PEAKS]
    order = order[scores[order] >= least_score]
    rows, columns = rows[order], columns[order]
    boxes = _boxes(answer[len(CLASSES) :, rows, columns], rows, columns)
    boxes[:, 2] -= sensor_height_m
    return Peaks(classes[order], logits[order], scores[order], boxes).take(drop_overlaps(boxes))


def score(calibration: Floats, classes: Integers, logits: Floats) -> Floats:
    """(n,) the scores of `classes` (n,) with these `logits` (n,)."""
    slopes, offsets = calibration[classes].T
    # Beyond, the exponential would overflow, and the score is 0 or 1 to the last bit.
    return np.asarray(1 / (1 + np.exp(-np.clip(slopes * logits + offsets, -700, 700))))


def _highest_around(planes: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return (n, h, w) the highest value of every cell of `planes` (n, h, w) and the eight around
    it.
    """
    edged = np.pad(planes, ((0, 0), (1, 1), (1, 1)), constant_values=-np.inf)
    rows = np.maximum(np.maximum(edged[:, :-2], edged[:, 1:-1]), edged[:, 2:])
    highest: NDArray[np.float32] = np.maximum(rows[..., :-2], rows[..., 1:-1])
    return np.maximum(highest, rows[..., 2:])


def _boxes(told: NDArray[np.float32], rows: Integers, columns: Integers) -> Floats:
    """(n, 7) with heights above the road, from BOX_OUTPUTS (10, n)."""
    x, y, height, *log_sizes, cos, sin, cos2, sin2 = told.astype(np.float64)
    middles_x, middles_y = cell_centres()
    sizes = np.exp(np.clip(log_sizes, np.log(SMALLEST_M), np.log(LARGEST_M)))

    # The axis, in the way that the direction leans to.
    yaw = np.arctan2(sin2, cos2) / 2
    backwards = np.cos(yaw) * cos + np.sin(yaw) * sin < 0
    yaw = np.where(backwards, yaw + np.where(yaw > 0, -np.pi, np.pi), yaw)
    return np.stack(
        [middles_x[rows, 0] + x, middles_y[0, columns] + y, height, *sizes, yaw], axis=1
    )
