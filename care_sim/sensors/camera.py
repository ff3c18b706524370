"""A ground-truth camera: boxes read off the visible pixels, with injectable misses and latency."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from care_sim.errors import check_number, check_whole
from care_sim.frames import Floats
from care_sim.pinhole import PinholeCamera
from care_sim.types import ImageDetections
from care_sim.world.bullet import Integers, Window

CAMERA_FROM_LIDAR = (0.76, 0.0, -0.33)
"""Metres in the sensor frame: CAM_FRONT of nuScenes stands this far before and below LIDAR_TOP."""
CAMERA_HEIGHT = 180
CAMERA_WIDTH = 320
FRONT_CAMERA = PinholeCamera(CAMERA_WIDTH, CAMERA_HEIGHT, np.deg2rad(90.0), CAMERA_FROM_LIDAR)
"""90 degrees wide, the default of CARLA's RGB camera, in which the paper ran."""

MIN_PIXELS = 12
"""Visible pixels below which an object has no box. At 320 x 180 this is 4 x 12 pixels at 640 x 360, and
an unoccluded adult at about 40 m."""
FULL_CONFIDENCE = 3 * MIN_PIXELS
"""Visible pixels at which n / (n + FULL_CONFIDENCE) is one half; the least box then has confidence
0.25, the detector threshold of the paper."""


@dataclass(frozen=True)
class CameraFaults:
    """`false_negative_rate` per detection and frame, `latency` in whole keyframes."""

    false_negative_rate: float = 0.0
    latency: int = 0

    def __post_init__(self) -> None:
        check_number("false_negative_rate", self.false_negative_rate, 0, 1)
        check_whole("camera_latency", self.latency, 0)


def window_on(camera: PinholeCamera, boxes: Floats) -> Window:
    """The rectangle of the picture that holds every sensor-frame box (n, 7); empty when none is in view."""
    rectangles = camera.project_boxes(boxes)
    low = np.clip(np.floor(rectangles[:, :2]) - 1, 0, None)
    high = np.clip(np.ceil(rectangles[:, 2:]) + 1, None, (camera.width, camera.height))
    visible = np.all(low < high, axis=1)
    if not visible.any():
        return 0, 0, 0, 0
    left, top = low[visible].min(axis=0).astype(int).tolist()
    right, bottom = high[visible].max(axis=0).astype(int).tolist()
    return left, top, right, bottom


@dataclass(frozen=True)
class Picture:
    """What the unimpaired camera shows: `bodies` (n,) ids, image `boxes` (n, 4) and `pixels` (n,) visible."""

    bodies: Integers
    boxes: Floats
    pixels: Integers

    @classmethod
    def of(cls, ids: Integers, window: Window | None = None) -> "Picture":
        """Read the box of every body off a picture of ids (height, width), or off a window of it."""
        left, top, right, bottom = window if window is not None else (0, 0, *ids.shape[::-1])
        labels = ids[top:bottom, left:right] + 1
        visible = np.bincount(labels.ravel())
        found = ndimage.find_objects(labels) if labels.size else []
        rows = [
            (body, s[1].start + left, s[0].start + top, s[1].stop + left, s[0].stop + top, visible[body + 1])
            for body, s in enumerate(found)
            if s is not None
        ]
        table = np.array(rows, dtype=np.int64).reshape(-1, 6)
        return cls(table[:, 0], table[:, 1:5].astype(float), table[:, 5])

    def shows(self, body: int) -> bool:
        """Whether enough of a body is visible for a box."""
        return bool(np.any((self.bodies == body) & (self.pixels >= MIN_PIXELS)))


class CameraDetector:
    """Turns pictures into detections: knows the classes of the reported bodies, misses some, is late.

    Misses are drawn for every body in every frame, seen or not, so that every policy meets the same
    ones. `labels` maps body ids to classes; bodies that it does not hold are not detected.
    """

    def __init__(self, labels: Mapping[int, int], faults: CameraFaults, keyframe_s: float, rng: np.random.Generator):
        self._labels = labels
        self._faults = faults
        self._keyframe_s = keyframe_s
        self._rng = rng
        self._frames: deque[tuple[ImageDetections, float]] = deque(maxlen=int(faults.latency) + 1)

    def detect(self, picture: Picture, heading: float) -> ImageDetections:
        """The newest detections that are due, the surest first; `picture` is the latest, taken at `heading`."""
        self._frames.append((self._look(picture), heading))
        if len(self._frames) <= self._faults.latency:
            return _NOTHING_SEEN
        detections, heading_then = self._frames[0]
        age = self._faults.latency * self._keyframe_s
        return replace(
            detections,
            ages=np.full(len(detections), age),
            yaw_changes=np.full(len(detections), heading - heading_then),
        )

    def _look(self, picture: Picture) -> ImageDetections:
        draws = self._rng.random(len(self._labels))
        missed = {
            body for body, draw in zip(self._labels, draws, strict=True) if draw < self._faults.false_negative_rate
        }
        seen = np.array(
            [
                pixels >= MIN_PIXELS and body in self._labels and body not in missed
                for body, pixels in zip(picture.bodies.tolist(), picture.pixels.tolist(), strict=True)
            ],
            dtype=bool,
        )
        pixels, boxes = picture.pixels[seen], picture.boxes[seen]
        order = np.lexsort((boxes[:, 0], -pixels))
        classes = np.array([self._labels[body] for body in picture.bodies[seen].tolist()], dtype=np.int64)
        zeros = np.zeros(len(classes))
        return ImageDetections(
            classes[order],
            (pixels / (pixels + FULL_CONFIDENCE))[order],
            boxes[order],
            zeros.astype(np.int64),
            zeros,
            zeros,
        )


_NOTHING_SEEN = ImageDetections.from_rows(np.empty((0, len(ImageDetections.COLUMNS))))
