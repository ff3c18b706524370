"""Pictures of a camera without faults: the boxes of bodies, read off the visible pixels.

A table of boxes is (n, 6): the id of a body, its box (left, top, right, bottom) and its number of
pixels (`care_sim.sensors.engines`). The box holds all pixels of the body.
"""

from collections.abc import Mapping, Sequence
from typing import TypeVar

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.types import ImageDetections
from care_sim.sensors.annotated import IdentifiedDetections

CAMERA_FROM_LIDAR = (0.76, 0.0, -0.33)
"""Metres in the sensor frame: CAM_FRONT of nuScenes is this far before and below LIDAR_TOP."""


CAMERA_HEIGHT = 180
CAMERA_WIDTH = 320
FRONT_CAMERA = PinholeCamera(CAMERA_WIDTH, CAMERA_HEIGHT, np.deg2rad(90.0), CAMERA_FROM_LIDAR)
"""90 degrees wide, the default of CARLA's RGB camera, in which the paper ran."""

MIN_PIXELS = 12
"""Visible pixels below which an object has no box. At 320 x 180 this is 4 x 12 pixels at 640 x 360,
and an unoccluded adult at about 40 m."""
FULL_CONFIDENCE = 3 * MIN_PIXELS
"""Visible pixels at which n / (n + FULL_CONFIDENCE) is one half; the least box then has confidence
0.25, the detector threshold of the paper."""

Pixels = TypeVar("Pixels", float, Floats)

# Compiled code can only read module-level constants.
_CLASS, _CONFIDENCE = ImageDetections.CLASS, ImageDetections.CONFIDENCE
_LEFT, _CAMERA = ImageDetections.LEFT, ImageDetections.CAMERA
_COLUMNS = len(ImageDetections.COLUMNS)


def confidence_of(pixels: Pixels) -> Pixels:
    """How sure the detector is of a box of so many visible pixels, from 0 to 1."""
    return pixels / (pixels + FULL_CONFIDENCE)


def pixels_of(confidences: Floats) -> Floats:
    """(n,) the visible pixels that would give these confidences, very many for 1."""
    # c = n / (n + F) solved for n; a confidence of 1 would need infinitely many.
    return FULL_CONFIDENCE * confidences / np.maximum(1 - confidences, 1e-12)


def faultless_detections(
    tables: Sequence[Integers], labels: Mapping[int, int]
) -> IdentifiedDetections:
    """Return the faultless detections: a box for every body that has a class in `labels` and shows
    enough pixels. `tables` of boxes are one per camera of the rig, in its order.
    """
    classes = np.full(max(labels, default=-1) + 1, -1)
    classes[list(labels)] = list(labels.values())
    most, count = sum(map(len, tables)), 0
    rows, bodies = np.zeros((most, _COLUMNS)), np.zeros(most, np.int64)
    for camera, table in enumerate(tables):
        count = add_reported(table, classes, camera, rows, bodies, count)
    return IdentifiedDetections(ImageDetections.from_checked_rows(rows[:count]), bodies[:count])


@compiled()
def add_reported(
    table: Integers, classes: Integers, camera: int, rows: Floats, ids: Integers, count: int
) -> int:
    """Add detections to the `count` first of `rows` (D, 9), in the order of
    `ImageDetections.COLUMNS`, and to their `ids` (D,). Return how many there are then. A body in a
    table of boxes is detected if it has a class and shows enough pixels. `classes` are by body id,
    -1 without one.
    """
    for n in range(len(table)):
        body, pixels = table[n, 0], table[n, 5]
        if 0 <= body < len(classes) and classes[body] >= 0 and pixels >= MIN_PIXELS:
            one = rows[count]
            one[:] = 0.0
            one[_CLASS] = classes[body]
            # As `confidence_of` has it.
            one[_CONFIDENCE] = pixels / (pixels + FULL_CONFIDENCE)
            for k in range(4):
                one[_LEFT + k] = table[n, 1 + k]
            one[_CAMERA] = camera
            ids[count] = body
            count += 1
    return count


@compiled()
def comes_before(one: Floats, other: Floats, by_all: bool) -> bool:
    """Whether a detection (9,) is surer than another one, or of equally sure ones more to the left.
    `by_all`, their numbers decide about equals, from the last column on.
    """
    if one[_CONFIDENCE] != other[_CONFIDENCE]:
        return bool(one[_CONFIDENCE] > other[_CONFIDENCE])
    if one[_LEFT] != other[_LEFT]:
        return bool(one[_LEFT] < other[_LEFT])
    for column in range(len(one) - 1, -1, -1):
        if by_all and one[column] != other[column]:
            return bool(one[column] < other[column])
    return False
