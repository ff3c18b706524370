"""What a camera without faults shows: the boxes of bodies, read off the visible pixels."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.types import ImageDetections
from care_sim.sensors.annotated import IdentifiedDetections
from care_sim.sensors.engines.picture_kernels import boxes_of_window, visible_boxes
from care_sim.world.bullet import PixelWindow

MIN_PIXELS = 12
"""Visible pixels below which an object has no box. At 320 x 180 this is 4 x 12 pixels at 640 x 360,
and an unoccluded adult at about 40 m."""
FULL_CONFIDENCE = 3 * MIN_PIXELS
"""Visible pixels at which n / (n + FULL_CONFIDENCE) is one half; the least box then has confidence
0.25, the detector threshold of the paper."""

Pixels = TypeVar("Pixels", float, Floats)


def confidence_of(pixels: Pixels) -> Pixels:
    """The confidence, from 0 to 1, of a box of so many visible pixels."""
    return pixels / (pixels + FULL_CONFIDENCE)


def pixels_of(confidences: Floats) -> Floats:
    """(n,) the visible pixels that would give these confidences, very many for 1."""
    # c = n / (n + F) solved for n; a confidence of 1 would need infinitely many.
    return FULL_CONFIDENCE * confidences / np.maximum(1 - confidences, 1e-12)


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
            # As `care_sim.sensors.pictures.confidence_of` has it.
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


CAMERA_FROM_LIDAR = (0.76, 0.0, -0.33)
"""Metres in the sensor frame: CAM_FRONT of nuScenes is this far before and below LIDAR_TOP."""


CAMERA_HEIGHT = 180


CAMERA_WIDTH = 320


FRONT_CAMERA = PinholeCamera(CAMERA_WIDTH, CAMERA_HEIGHT, np.deg2rad(90.0), CAMERA_FROM_LIDAR)
"""90 degrees wide, the default of CARLA's RGB camera, in which the paper ran."""


_NO_ROWS = np.empty((0, len(ImageDetections.COLUMNS)))


_NO_BODIES = np.empty(0, np.int64)


def window_on(camera: PinholeCamera, boxes: Floats) -> PixelWindow:
    """The rectangle of the picture that holds every sensor-frame box (n, 7); empty when none is in
    view.
    """
    return camera.window_on(boxes)


@dataclass(frozen=True)
class Picture:
    """What a camera shows: `bodies` (n,) ids, image `boxes` (n, 4) and `pixels` (n,)
    visible.
    """

    bodies: Integers
    boxes: Floats
    pixels: Integers

    @classmethod
    def of(cls, ids: Integers, window: PixelWindow | None = None) -> "Picture":
        """Read the box of every body off a picture of ids (height, width), all of it or that of a
        window.
        """
        return cls.listed(visible_boxes(ids) if window is None else boxes_of_window(ids, window))

    @classmethod
    def listed(cls, table: Integers) -> "Picture":
        """What a table of an engine's `visible_boxes` tells."""
        return cls(table[:, 0], table[:, 1:5].astype(np.float64), table[:, 5])

    def shows(self, body: int) -> bool:
        """Whether enough of a body is visible for a box."""
        return body in self._shown

    @cached_property
    def _shown(self) -> frozenset[int]:
        return frozenset(self.bodies[self.pixels >= MIN_PIXELS].tolist())


def class_table(labels: Mapping[int, int]) -> Integers:
    """The class of every body by its id, -1 of those that `labels` does not map to one."""
    table = np.full(max(labels, default=-1) + 1, -1)
    table[list(labels)] = list(labels.values())
    return table


def faultless_detections(pictures: Sequence[Picture], classes: Integers) -> IdentifiedDetections:
    """What the camera detector reports without faults: a box for every body that has a class in the
    `class_table` and shows enough pixels.

    `pictures` are one per camera of the rig, in its order.
    """
    parts = [
        reported_boxes(picture.bodies, picture.boxes, picture.pixels, classes, camera)
        for camera, picture in enumerate(pictures)
    ]
    rows = np.concatenate([_NO_ROWS, *(rows for rows, _ in parts)])
    bodies = np.concatenate([_NO_BODIES, *(bodies for _, bodies in parts)])
    return IdentifiedDetections(ImageDetections.from_checked_rows(rows), bodies)
