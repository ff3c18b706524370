"""A ground-truth camera: boxes read off the visible pixels."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from care_sim.conditions import Sensing
from care_sim.frames import Floats
from care_sim.pinhole import PinholeCamera
from care_sim.sensors.camera_faults import Delay, Ghosts, Misses, mounted
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
    """Turns pictures into detections: knows the classes of the reported bodies, and errs as `sensing` says.

    `labels` maps body ids to classes; bodies that it does not hold are not detected. `camera` is the camera
    that the rig knows, `height_m` that of the sensor frame above the road.
    """

    def __init__(
        self,
        labels: Mapping[int, int],
        sensing: Sensing,
        keyframe_s: float,
        seed: np.random.SeedSequence,
        camera: PinholeCamera = FRONT_CAMERA,
        height_m: float = 1.84,
    ):
        ghosts, delay, mount = (np.random.default_rng(child) for child in seed.spawn(3))
        self._labels, self._sensing = labels, sensing
        self._misses = Misses(len(labels), sensing, np.random.default_rng(seed))
        self._ghosts = Ghosts(camera, height_m, sensing.false_positive_rate, ghosts)
        self._delay = Delay(sensing.camera_latency, sensing.camera_jitter, keyframe_s, delay)
        self.mounted = mounted(camera, sensing, mount)
        """The camera as it really stands."""

    def detect(self, picture: Picture, heading: float, ranges: Floats, time_s: float) -> ImageDetections:
        """The newest detections that are due, the surest first; `picture` is the latest, taken at `heading`.

        `ranges` (n,) are the distances of the labelled bodies in metres, in the order of the labels.
        """
        seen = self._seen(picture, self._misses.draw(ranges)), self._ghosts.draw()
        rows = np.concatenate([detections.rows() for detections in seen])
        kept = rows[(rows[:, 1] >= self._sensing.camera_confidence) & (not self._sensing.black_at(time_s))]
        surest_first = kept[np.lexsort((kept[:, 2], -kept[:, 1]))]
        return self._delay.newest(ImageDetections.from_rows(surest_first), heading)

    def _seen(self, picture: Picture, missed: NDArray[np.bool_]) -> ImageDetections:
        found = {body for body, is_missed in zip(self._labels, missed.tolist(), strict=True) if not is_missed}
        seen = (picture.pixels >= MIN_PIXELS) & np.array(
            [body in found for body in picture.bodies.tolist()], dtype=bool
        )
        pixels, bodies = picture.pixels[seen], picture.bodies[seen].tolist()
        classes = np.array([self._labels[body] for body in bodies], dtype=np.int64)
        zeros = np.zeros(len(bodies))
        confidences = pixels / (pixels + FULL_CONFIDENCE)
        return ImageDetections(classes, confidences, picture.boxes[seen], zeros.astype(np.int64), zeros, zeros)
