"""A ground-truth camera: boxes read off the visible pixels."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from care_sim.base.times import LAST_BITS_S
from care_sim.core.arrays import Floats, Integers
from care_sim.core.cells.boxes import planar_ranges
from care_sim.core.conditions import KITTI_CAMERA, YOLOX_CAMERA, CameraFaults, Sensing
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.types import ImageDetections
from care_sim.sensors.annotated import NO_OBJECT, IdentifiedDetections
from care_sim.sensors.camera_errors import ProfiledDetector
from care_sim.sensors.camera_faults import Delay, Detected, Misses
from care_sim.sensors.camera_profiles import YOLOX
from care_sim.sensors.false_boxes import EMPTY_POOL, NO_ROWS, BoxPool, FalseBoxes
from care_sim.sensors.kitti.detector import KittiDetector
from care_sim.sensors.pictures import sort_by_confidence


class PictureTiming(NamedTuple):
    """When pictures are taken and arrive. Each keyframe has a picture, taken `after_s` seconds
    later. Its detections arrive `keyframes` keyframes later.
    """

    keyframes: int
    after_s: float


def picture_timing(faults: CameraFaults, keyframe_s: float, step_s: float) -> PictureTiming:
    """Return the timing that `faults` set. Pictures can be taken every `step_s` seconds; a keyframe
    of `keyframe_s` is a whole number of steps. The newest picture that is at least as old as a
    latency in seconds is used.
    """
    if not faults.camera_latency_s:
        return PictureTiming(faults.camera_latency, 0.0)
    # Rounded up to steps; they are counted back from the keyframe at which the detections arrive.
    steps = math.ceil((faults.camera_latency_s - LAST_BITS_S) / step_s)
    per_keyframe = round(keyframe_s / step_s)
    keyframes = -(-steps // per_keyframe)
    return PictureTiming(keyframes, (keyframes * per_keyframe - steps) * step_s)


_HERE = np.ones(1, np.bool_)
NOTHING_SEEN = IdentifiedDetections(
    ImageDetections.from_rows(np.empty((0, len(ImageDetections.COLUMNS)))), np.empty(0, np.int64)
)


def mounted(camera: PinholeCamera, faults: CameraFaults, rng: np.random.Generator) -> PinholeCamera:
    """Return the camera as mounted, with errors of pose that the rig does not know."""
    # Draw even where a spread is 0: switching on one error then leaves the other's draws unchanged.
    yaw, pitch = np.deg2rad(faults.camera_rotation_sigma_deg) * rng.standard_normal(2)
    shift = faults.camera_position_sigma_m * rng.standard_normal(3)
    x, y, z = (float(value) for value in camera.position + shift)
    return replace(
        camera, position=(x, y, z), yaw=camera.yaw + float(yaw), pitch=camera.pitch + float(pitch)
    )


class CameraDetector:
    """Turns faultless detections into those that arrive, with the errors and delays of `sensing`.
    `objects` (n,) are all objects that the detector may ever report. `cameras` are those that the
    rig knows. False boxes are drawn from `pool`. Pictures can be taken every `step_s` seconds, by
    default at keyframes only.
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
        false_boxes, _, mount = (np.random.default_rng(child) for child in own)
        self._objects = np.asarray(objects, np.int64)
        self._sensing = sensing
        self._least_confidence = float(sensing.camera_confidence)
        self._misses = Misses([sensing])
        self._misses.begin(0, seed, len(objects))
        rate = sensing.false_positive_rate
        self._false_boxes = FalseBoxes(pool, rate, len(cameras), false_boxes) if rate else None
        self.timing = picture_timing(sensing, keyframe_s, step_s or keyframe_s)
        late = np.array([self.timing.keyframes]), np.array([sensing.camera_jitter])
        self._delay = Delay(*late, keyframe_s, self.timing.after_s)
        self._delay.begin(0, own[1])
        self.mounted = tuple(mounted(camera, sensing, mount) for camera in cameras)
        """The cameras as mounted, errors included."""
        self._measured: ProfiledDetector | KittiDetector | None = None
        seeds = errors, jitter, confusion, ghosts
        objects_seen = self._objects, self.mounted, keyframe_s
        if sensing.camera_profile == YOLOX_CAMERA:
            self._measured = ProfiledDetector(YOLOX, *objects_seen, pool, seeds)
        elif sensing.camera_profile == KITTI_CAMERA:
            self._measured = KittiDetector(*objects_seen, seeds)

    def detect(
        self, seen: IdentifiedDetections, heading: float, boxes: Floats, time_s: float
    ) -> IdentifiedDetections:
        """Take a keyframe's pictures and return the newest detections: `take`, then `newest`."""
        self.take(seen, heading, boxes, time_s)
        return self.newest(heading)

    def take(
        self, seen: IdentifiedDetections, heading: float, boxes: Floats, time_s: float
    ) -> None:
        """Take the pictures of a keyframe. `seen` are their faultless detections, at `time_s` and
        with the car's `heading`. `boxes` (n, 7) are those of all objects in the sensor frame, in
        their order, 0 for an absent object.
        """
        # All faults draw at every keyframe, whatever is visible, so that every policy meets the
        # same faults.
        rows = seen.detections.rows()
        objects = seen.objects
        missed = self._misses.draw(_HERE, planar_ranges(boxes)[None])[0]
        false = self._false_boxes.draw(rows, time_s) if self._false_boxes else NO_ROWS
        if self._measured is not None:
            rows, objects, false = self._measured.detect(seen, boxes, false, time_s)
        if missed.any():
            left = ~np.isin(objects, self._objects[missed])
            rows = rows[left]
            objects = objects[left]
        if len(false):
            if seen.pictures is not None:
                cameras = false[:, ImageDetections.CAMERA].astype(np.int64)
                false[:, ImageDetections.TIMING] = seen.pictures[cameras]
            rows, objects = _with_false_boxes(rows, objects, false)
        # Edges of `yolox` and of plain false boxes are whole on false boxes alone, which published
        # episodes hold. The next version of the benchmark rounds all of them in this line:
        # rows[:, ImageDetections.BOX] = np.trunc(rows[:, ImageDetections.BOX])

        # In the dark nothing is reported, false boxes included; delays go on.
        if self._sensing.black_at(time_s):
            rows, objects = rows[:0], objects[:0]
        # The leftmost of equally sure boxes comes first: nothing depends on the order of bodies.
        rows, objects = sort_by_confidence(rows, objects, self._least_confidence)
        seen_here = Detected(np.array([len(rows)]), rows[None], objects[None])
        self._delay.take(_HERE, seen_here, np.array([heading], float))

    def newest(self, heading: float) -> IdentifiedDetections:
        """Begin a keyframe with the car's `heading`. Return the newest detections that are due, the
        surest first, each with the object behind it.
        """
        return self._delay.newest(_HERE, np.array([heading], float)).take(0)


def _with_false_boxes(rows: Floats, objects: Integers, false: Floats) -> tuple[Floats, Integers]:
    """Merge true and `false` boxes, ordered by their numbers alone. Boxes of equal confidence and
    left edge keep this order, so the order must not reveal which are false.
    """
    together = np.concatenate([rows, false])
    order = np.lexsort(together.T)
    return together[order], np.append(objects, np.full(len(false), NO_OBJECT))[order]
