"""A ground-truth camera: boxes read off the visible pixels."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.cells.boxes import planar_ranges
from care_sim.core.conditions import Sensing
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.types import ImageDetections
from care_sim.sensors.annotated import NO_OBJECT, IdentifiedDetections
from care_sim.sensors.box_pool import EMPTY_POOL, BoxPool
from care_sim.sensors.camera_faults import Delay, Misses, mounted
from care_sim.sensors.camera_kernels import reported_boxes, surest_first
from care_sim.sensors.camera_profiles import PROFILES
from care_sim.sensors.confidence import MIN_PIXELS
from care_sim.sensors.engines.box_kernels import boxes_of_window, visible_boxes
from care_sim.sensors.false_boxes import FalseBoxes
from care_sim.sensors.picture_timing import picture_timing
from care_sim.sensors.profiled_detector import ProfiledDetector
from care_sim.world.bullet import PixelWindow

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


class CameraDetector:
    """Makes of faultless detections those that arrive: they err and lag as `sensing` says.

    `objects` (n,) are all that the detector may ever report; `cameras` those that the rig knows.
    False boxes are made from `pool`. Pictures can be taken every `step_s` seconds, by default at
    keyframes alone.
    """

    def __init__(
        self,
        objects: Sequence[int],
        sensing: Sensing,
        keyframe_s: float,
        seed: np.random.SeedSequence,
        cameras: Sequence[PinholeCamera],
        pool: BoxPool = EMPTY_POOL,
        step_s: float | None = None,
    ):
        # Every fault has a random stream of its own: one switched on leaves the others as they are.
        *own, errors, jitter, confusion, ghosts = seed.spawn(7)
        false_boxes, delay, mount = (np.random.default_rng(child) for child in own)
        self._objects = np.asarray(objects, np.int64)
        self._sensing = sensing
        self._least_confidence = float(sensing.camera_confidence)
        self._misses = Misses(len(objects), sensing, np.random.default_rng(seed))
        self._false_boxes = FalseBoxes(pool, sensing.false_positive_rate, len(cameras), false_boxes)
        self.timing = picture_timing(sensing, keyframe_s, step_s or keyframe_s)
        self._delay = Delay(self.timing, sensing.camera_jitter, keyframe_s, delay)
        self.mounted = tuple(mounted(camera, sensing, mount) for camera in cameras)
        """The cameras as they really stand."""
        self._profiled = self._profiled_detector(
            keyframe_s, pool, (errors, jitter, confusion, ghosts)
        )

    def detect(
        self, seen: IdentifiedDetections, heading: float, boxes: Floats, time_s: float
    ) -> IdentifiedDetections:
        """The newest detections at a keyframe whose pictures are taken at the keyframe itself: see
        `take` and `newest`.
        """
        self.take(seen, heading, boxes, time_s)
        return self.newest(heading)

    def take(
        self, seen: IdentifiedDetections, heading: float, boxes: Floats, time_s: float
    ) -> None:
        """Take in the pictures of a keyframe.

        `seen` are their faultless detections, at `time_s` and with the car's `heading`; `boxes`
        (n, 7) are those of the objects in the sensor frame, in their order, 0 of one that is
        nowhere.
        """
        # All faults draw at every keyframe, whatever is there and whatever becomes of it, so that
        # every policy meets the same ones.
        rows = seen.detections.rows()
        objects = seen.objects
        missed = self._misses.draw(planar_ranges(boxes))
        false = self._false_boxes.draw(rows, time_s)
        if self._profiled is not None:
            ghosts = self._profiled.ghosts(np.concatenate([rows, false]), time_s)
            false = np.concatenate([false, ghosts])
            rows, objects = self._profiled.report(seen, boxes)
        if missed.any():
            left = ~np.isin(objects, self._objects[missed])
            rows = rows[left]
            objects = objects[left]
        if len(false):
            if seen.pictures is not None:
                cameras = false[:, ImageDetections.CAMERA].astype(np.int64)
                false[:, ImageDetections.TIMING] = seen.pictures[cameras]
            rows, objects = _with_false_boxes(rows, objects, false)

        # In the dark nothing is reported, false boxes included; delays go on.
        if self._sensing.black_at(time_s):
            rows, objects = rows[:0], objects[:0]
        # Of equally sure boxes the leftmost comes first: nothing depends on the order of bodies.
        rows, objects = surest_first(rows, objects, self._least_confidence)
        detections = ImageDetections.from_checked_rows(rows)
        self._delay.take(IdentifiedDetections(detections, objects), heading)

    def newest(self, heading: float) -> IdentifiedDetections:
        """Begin a keyframe with the car's `heading`: the newest detections that are due, the surest
        first, each with the object behind it.
        """
        return self._delay.newest(heading)

    def _profiled_detector(
        self, keyframe_s: float, pool: BoxPool, seeds: Sequence[np.random.SeedSequence]
    ) -> ProfiledDetector | None:
        """The detector of the profile, None of the ideal camera."""
        profile = PROFILES[self._sensing.camera_profile]
        if profile is None:
            return None
        return ProfiledDetector(profile, self._objects, self.mounted, keyframe_s, pool, seeds)


def _with_false_boxes(rows: Floats, objects: Integers, false: Floats) -> tuple[Floats, Integers]:
    """True and `false` boxes in an order of their numbers alone.

    Boxes of equal confidence and left edge keep this order, so it must not tell which are false.
    """
    together = np.concatenate([rows, false])
    order = np.lexsort(together.T)
    return together[order], np.append(objects, np.full(len(false), NO_OBJECT))[order]
