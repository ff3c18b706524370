"""A ground-truth camera: boxes read off the visible pixels."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.base.threads import ALONE, Threads
from care_sim.base.times import LAST_BITS_S
from care_sim.core.arrays import ONE_WORLD, Floats, Integers, Mask, filled
from care_sim.core.conditions import KITTI_CAMERA, YOLOX_CAMERA, CameraFaults, Sensing
from care_sim.core.pinhole import PinholeCamera, mounted_cameras
from care_sim.core.rows import copy_row
from care_sim.core.types import ImageDetections
from care_sim.sensors.annotated import NO_OBJECT, IdentifiedDetections
from care_sim.sensors.camera_errors import ProfiledDetector
from care_sim.sensors.camera_faults import Delay, Detected, Misses, place_of
from care_sim.sensors.camera_profiles import YOLOX
from care_sim.sensors.false_boxes import EMPTY_POOL, NO_ROWS, BoxPool, FalseBoxes
from care_sim.sensors.kitti.detector import KittiDetectors
from care_sim.sensors.pictures import comes_before

# Compiled code can only read module-level constants.
_AGE, _CAMERA = ImageDetections.AGE, ImageDetections.CAMERA
_CONFIDENCE = ImageDetections.CONFIDENCE


def picture_timing(faults: CameraFaults, keyframe_s: float, step_s: float) -> tuple[int, float]:
    """Return how many keyframes later a keyframe's detections arrive, and how many seconds after
    the keyframe its picture is taken. Pictures can be taken every `step_s` seconds; a keyframe of
    `keyframe_s` is a whole number of steps. The newest picture that is at least as old as a latency
    in seconds is used.
    """
    if not faults.camera_latency_s:
        return faults.camera_latency, 0.0
    # Rounded up to steps; they are counted back from the keyframe at which the detections arrive.
    steps = math.ceil((faults.camera_latency_s - LAST_BITS_S) / step_s)
    per_keyframe = round(keyframe_s / step_s)
    keyframes = -(-steps // per_keyframe)
    return keyframes, (keyframes * per_keyframe - steps) * step_s


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


class CameraDetectors:
    """Turn the faultless detections of W worlds into those that arrive, with the errors and delays
    of `sensing` (W,). `cameras` are those that the rig knows. Pictures can be taken every `step_s`
    seconds, by default at keyframes only. Returned arrays are reused at the next keyframe.
    """

    def __init__(
        self,
        sensing: Sequence[Sensing],
        keyframe_s: float,
        cameras: Sequence[PinholeCamera],
        step_s: float | None = None,
        threads: Threads = ALONE,
    ):
        worlds = len(sensing)
        self._sensing = sensing
        self._keyframe_s = keyframe_s
        self._designed = tuple(cameras)
        self._least = np.array([float(each.camera_confidence) for each in sensing])
        self._misses = Misses(sensing)
        timings = [picture_timing(each, keyframe_s, step_s or keyframe_s) for each in sensing]
        latencies, self.after_s = map(np.array, zip(*timings, strict=True))
        """(W,) seconds from a keyframe to the pictures that it takes."""
        jitters = np.array([each.camera_jitter for each in sensing])
        self._delay = Delay(latencies, jitters, keyframe_s, self.after_s)
        self._is_late = bool(latencies.any() or jitters.any())
        self._is_ever_dark = any(each.blackout_s for each in sensing)
        errors = [(one.camera_rotation_sigma_deg, one.camera_position_sigma_m) for one in sensing]
        self.errs = np.array([any(one) for one in errors])
        """(W,) where the cameras are not mounted as designed."""
        self.mounted = [self._designed] * worlds
        """(W,) the cameras as mounted, errors included."""
        self.cameras = mounted_cameras(worlds, cameras)
        """The same, for compiled code."""
        self._objects = np.zeros(worlds, np.int64), np.zeros((worlds, 0), np.int64)
        self._false_boxes: dict[int, FalseBoxes] = {}
        self._profiled: dict[int, ProfiledDetector] = {}
        self._is_kitti = np.array([each.camera_profile == KITTI_CAMERA for each in sensing])
        self._kitti = (
            KittiDetectors(worlds, len(cameras), keyframe_s, threads)
            if self._is_kitti.any()
            else None
        )
        self._taken = Detected.of(worlds, 0)

    def begin(
        self, world: int, objects: Sequence[int], seed: np.random.SeedSequence, pool: BoxPool
    ) -> None:
        """Begin an episode with the `objects` (n,) that may ever be reported. False boxes are drawn
        from `pool`.
        """
        # Every fault has a random stream of its own: one switched on leaves the others as they are.
        *own, errors, jitter, confusion, ghosts = seed.spawn(7)
        sensing, cameras = self._sensing[world], self._designed
        counts, numbers = self._objects
        own_objects = np.asarray(objects, np.int64)
        counts[world] = len(own_objects)
        self._objects = counts, filled(numbers, world, own_objects)
        self._misses.begin(world, seed, len(objects))
        self._delay.begin(world, own[1])
        if sensing.false_positive_rate:
            rng = np.random.default_rng(own[0])
            made = FalseBoxes(pool, sensing.false_positive_rate, len(cameras), rng)
            self._false_boxes[world] = made
        if self.errs[world]:
            rng = np.random.default_rng(own[2])
            cameras = tuple(mounted(camera, sensing, rng) for camera in cameras)
            self.mounted[world] = cameras
            self.cameras.mounts[world] = mounted_cameras(1, cameras).mounts[0]
        seeds = errors, jitter, confusion, ghosts
        if sensing.camera_profile == YOLOX_CAMERA:
            given = own_objects, cameras, self._keyframe_s, pool, seeds
            self._profiled[world] = ProfiledDetector(YOLOX, *given)
        elif self._kitti and self._is_kitti[world]:
            self._kitti.begin(world, len(objects), cameras, seeds)

    def take(
        self,
        live: Mask,
        seen: Detected,
        headings: Floats,
        boxes: Floats,
        times: Floats,
        visible: Floats | None = None,
        pictures: Floats | None = None,
    ) -> None:
        """Take the pictures of a keyframe in the worlds that are `live`. `seen` are their faultless
        detections, at `times` (W,) and with the cars' `headings` (W,). `boxes` (W, n, 7) are those
        of all objects in the sensor frame, in their order, 0 for an absent object. A source may
        annotate `visible` (W, D) and `pictures` (W, k, 2) as in `care_sim.sensors.annotated`.
        """
        # All faults draw at every keyframe, whatever is visible, so that every policy meets the
        # same faults.
        visible = np.empty((len(live), 0)) if visible is None else visible
        pictures = np.empty((len(live), 0, 2)) if pictures is None else pictures
        missed = self._misses.draw(live, np.hypot(boxes[..., 0], boxes[..., 1]))
        # How many of each world's detections, the last ones, are false.
        false = np.zeros(len(live), np.int64)
        for world in np.flatnonzero(live).tolist():
            if world in self._false_boxes or world in self._profiled:
                seen = self._invented(world, seen, boxes, float(times[world]), visible, false)
        whose = live & self._is_kitti
        if self._kitti and whose.any():
            objects = *self._objects, boxes
            seen = self._kitti.detect(whose, seen, false, objects, visible, self.cameras)
        dark = np.zeros(len(live), np.bool_)
        if self._is_ever_dark:
            told = zip(self._sensing, times.tolist(), strict=True)
            dark = np.array([each.black_at(time_s) for each, time_s in told])
        _sort_out(live, seen, false, missed, self._objects, dark, pictures, self._least)
        self._taken = seen
        if self._is_late:
            self._delay.take(live, seen, headings)

    def newest(self, live: Mask, headings: Floats) -> Detected:
        """Begin a keyframe of the worlds that are `live`, with the cars' `headings` (W,). Return
        the newest detections that are due, the surest first, each with the object behind it.
        """
        return self._delay.newest(live, headings) if self._is_late else self._taken

    def _invented(
        self,
        world: int,
        seen: Detected,
        boxes: Floats,
        time_s: float,
        visible: Floats,
        false: Integers,
    ) -> Detected:
        """Return the detections with the reports of a profiled detector and false boxes of a world.
        Count these in `false` (W,).
        """
        own = seen.take(world)
        rows, objects = own.detections.rows(), own.objects
        invented = NO_ROWS
        if world in self._false_boxes:
            invented = self._false_boxes[world].draw(rows, time_s)
        if world in self._profiled:
            share = visible[world] if visible.shape[1] else None
            there = boxes[world, : self._objects[0][world]]
            given = replace(own, visible=share), there, invented, time_s
            rows, objects, invented = self._profiled[world].detect(*given)
        false[world] = len(invented)
        rows = np.concatenate([rows, invented])
        objects = np.append(objects, np.full(len(invented), NO_OBJECT))
        return seen.put(
            world, IdentifiedDetections(ImageDetections.from_checked_rows(rows), objects)
        )


@compiled(brief=True)
def _sort_out(
    live: Mask,
    seen: Detected,
    false: Integers,
    missed: Mask,
    known: tuple[Integers, Integers],
    dark: Mask,
    pictures: Floats,
    least: Floats,
) -> None:
    """Leave of the detections `seen` in the worlds that are `live` those of at least this
    confidence, the surest first. Drop those of `missed` (W, n) objects, and all where it is `dark`
    (W,). The last `false` (W,) ones, which no miss concerns, get the age of their `pictures`
    (W, k, 2). `known` are how many objects a world has (W,) and their numbers (W, n).
    """
    # Edges of `yolox` and of plain false boxes are whole on false boxes alone, which published
    # episodes hold. The next version of the benchmark rounds all of them here.
    for w in range(len(live)):
        if not live[w]:
            continue
        true, count = seen.counts[w] - false[w], 0
        for n in range(true, seen.counts[w] if pictures.shape[1] else 0):
            for k in range(2):
                seen.rows[w, n, _AGE + k] = pictures[w, int(seen.rows[w, n, _CAMERA]), k]
        # In the dark nothing is reported, false boxes included; delays go on.
        for n in range(0 if dark[w] else seen.counts[w]):
            is_sure = seen.rows[w, n, _CONFIDENCE] >= least[w]
            place = place_of(seen.objects[w, n], known[1][w, : known[0][w]]) if n < true else -1
            if is_sure and not (0 <= place < missed.shape[1] and missed[w, place]):
                _sort_in(seen, w, n, count, false[w] > 0)
                count += 1
        seen.counts[w] = count


@compiled(brief=True)
def _sort_in(seen: Detected, world: int, n: int, place: int, has_false: bool) -> None:
    """Put the detection n of a world among those before `place`, which are sorted."""
    # The leftmost of equally sure boxes comes first: nothing depends on the order of bodies, nor
    # may it reveal which boxes are false.
    rows, objects = seen.rows[world], seen.objects[world]
    row, body = rows[n].copy(), objects[n]
    while place > 0 and comes_before(row, rows[place - 1], has_false):
        objects[place] = objects[place - 1]
        copy_row(rows[place - 1], rows[place])
        place -= 1
    objects[place] = body
    copy_row(row, rows[place])


class CameraDetector:
    """The `CameraDetectors` of one world, in an episode with `objects` (n,)."""

    def __init__(
        self,
        objects: Sequence[int],
        sensing: Sensing,
        keyframe_s: float,
        seed: np.random.SeedSequence,
        cameras: Sequence[PinholeCamera],
        pool: BoxPool = EMPTY_POOL,
    ):
        self._all = CameraDetectors([sensing], keyframe_s, cameras)
        self._all.begin(0, objects, seed, pool)

    def detect(
        self, seen: IdentifiedDetections, heading: float, boxes: Floats, time_s: float
    ) -> IdentifiedDetections:
        """Take a keyframe's pictures and return the newest detections: see
        `CameraDetectors.take` and `CameraDetectors.newest`.
        """
        here, rows = Detected.of(1, len(seen)).put(0, seen), np.array([heading], float)
        told = (None if one is None else one[None] for one in (seen.visible, seen.pictures))
        self._all.take(ONE_WORLD, here, rows, boxes[None], np.array([time_s], float), *told)
        return self._all.newest(ONE_WORLD, rows).take(0)
