"""Detections of pictures, compiled: tables (n, 9) in the order of `ImageDetections.COLUMNS`."""

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers
from care_sim.core.types import ImageDetections
from care_sim.sensors.confidence import FULL_CONFIDENCE, MIN_PIXELS

# Numbers of a module are what compiled code can hold.
_CLASS, _CONFIDENCE = ImageDetections.CLASS, ImageDetections.CONFIDENCE
_LEFT, _CAMERA = ImageDetections.LEFT, ImageDetections.CAMERA
_COLUMNS = len(ImageDetections.COLUMNS)


@compiled()
def reported_boxes(
    bodies: Integers, boxes: Floats, pixels: Integers, classes: Integers, camera: int
) -> tuple[Floats, Integers]:
    """The detections of those `bodies` (n,) that have a class and show enough `pixels` (n,), and
    their ids (k,). `boxes` (n, 4) are theirs in the picture of `camera`; `classes` by body id, -1
    without one.
    """
    rows = np.zeros((len(bodies), _COLUMNS))
    ids = np.empty(len(bodies), np.int64)
    count = 0
    for n in range(len(bodies)):
        body = bodies[n]
        if 0 <= body < len(classes) and classes[body] >= 0 and pixels[n] >= MIN_PIXELS:
            one = rows[count]
            one[_CLASS] = classes[body]
            # As `care_sim.sensors.confidence.confidence_of` has it.
            one[_CONFIDENCE] = pixels[n] / (pixels[n] + FULL_CONFIDENCE)
            for k in range(4):
                one[_LEFT + k] = boxes[n, k]
            one[_CAMERA] = camera
            ids[count] = body
            count += 1
    return rows[:count], ids[:count]


@compiled()
def surest_first(rows: Floats, objects: Integers, least: float) -> tuple[Floats, Integers]:
    """The detections of at least this confidence, the surest first, of equally sure ones the
    leftmost, and the `objects` (n,) behind them.
    """
    order = np.empty(len(rows), np.int64)
    count = 0
    for n in range(len(rows)):
        if not rows[n, _CONFIDENCE] >= least:
            continue
        place = count
        while place > 0 and _comes_before(rows[n], rows[order[place - 1]]):
            order[place] = order[place - 1]
            place -= 1
        order[place] = n
        count += 1
    sorted_rows = np.empty((count, rows.shape[1]))
    behind = np.empty(count, np.int64)
    for place in range(count):
        behind[place] = objects[order[place]]
        for k in range(rows.shape[1]):
            sorted_rows[place, k] = rows[order[place], k]
    return sorted_rows, behind


@compiled()
def _comes_before(one: Floats, other: Floats) -> bool:
    if one[_CONFIDENCE] == other[_CONFIDENCE]:
        return bool(one[_LEFT] < other[_LEFT])
    return bool(one[_CONFIDENCE] > other[_CONFIDENCE])
