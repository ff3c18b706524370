"""What the cameras of all worlds show, and the detections that arrive.

The pictures are those of the engine `fast` (`care_sim.sensors.engines.picture_kernels`), the
detections those of an ideal camera (`care_sim.sensors.camera`): it may miss bodies, be late and
black, and takes its pictures at keyframes.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.batch.camera_faults import BatchDelay, BatchMisses, Detected
from care_sim.batch.state import BatchState, Bodies, Outlines, Reported, Sensors, seen_by
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.cells.boxes import planar_ranges
from care_sim.core.conditions import Sensing
from care_sim.core.frames import turned_alike
from care_sim.core.grid import copy_rows
from care_sim.core.pinhole import NEAR_M, CameraModels, model_of, window_on
from care_sim.core.rig import Rig
from care_sim.core.types import ImageDetections
from care_sim.sensors.camera import picture_timing
from care_sim.sensors.engines.picture_kernels import Line, draw_silhouettes, empty_line
from care_sim.sensors.engines.silhouette_kernels import (
    Silhouettes,
    lay_silhouettes,
    room_for,
)
from care_sim.sensors.engines.view_kernels import Lens, Meshes, PlacedCamera
from care_sim.sensors.pictures import MIN_PIXELS, reported_boxes, surest_first
from care_sim.world.bullet import FAR_M
from care_sim.world.world import WORLD_STEP_S, World

_DEPTHS = (NEAR_M, FAR_M)


class Cameras(NamedTuple):
    """The k cameras of a rig: their `models`; `mounts` (k, 4, 3), place and axes in the frame of
    the sensor; `sizes` (k, 2), width and height in pixels; and in each world the `least` (W,)
    confidence of a box.
    """

    models: CameraModels
    mounts: Floats
    sizes: Integers
    least: Floats


class _Room(NamedTuple):
    """Room that one picture after the other is drawn in; `found` (B, 6) is its table of boxes."""

    seen: Silhouettes
    line: Line
    found: Integers


class Sight:
    """The cameras of all worlds, which differ in their `conditions` alone.

    What it returns it fills anew at the next keyframe.
    """

    def __init__(self, rig: Rig, conditions: Sequence[Sensing]):
        models = rig.camera_models
        self._conditions = conditions
        self._cameras = Cameras(
            models,
            np.concatenate([models.positions[:, None], models.axes], axis=1),
            np.array([(camera.width, camera.height) for camera in rig.cameras]).reshape(-1, 2),
            np.array([float(each.camera_confidence) for each in conditions]),
        )
        timings = [picture_timing(each, rig.keyframe_s, WORLD_STEP_S) for each in conditions]
        latencies = np.array([timing.keyframes for timing in timings])
        jitters = np.array([each.camera_jitter for each in conditions])
        self._misses = BatchMisses(conditions)
        self._delay = BatchDelay(latencies, jitters, rig.keyframe_s)
        self._is_late = bool(latencies.any() or jitters.any())
        self._is_ever_dark = any(each.blackout_s for each in conditions)

    def begin(self, world: int, built: World, seed: np.random.SeedSequence) -> None:
        """Begin an episode; `seed` is that of the camera (`care_sim.loops.episode.SensorSeeds`)."""
        self._misses.begin(world, seed, len(built.labels()))
        if self._is_late:
            # The streams are those of `care_sim.sensors.camera.CameraDetector`.
            _, delay, *_ = seed.spawn(7)
            self._delay.begin(world, delay)

    def look(self, state: BatchState) -> tuple[Detected, Mask]:
        """Take the pictures of a keyframe: the newest detections that are due, and (W, B) which
        bodies a camera shows enough of for a box.
        """
        reported = state.reported
        boxes = np.zeros((*reported.bodies.shape, 7))
        _see_boxes(state.live, state.sensors, state.bodies, reported, boxes)
        most = len(self._cameras.sizes) * boxes.shape[1]
        seen = Detected(
            np.zeros(state.worlds, np.int64),
            np.zeros((state.worlds, most, len(ImageDetections.COLUMNS))),
        )
        shown = np.zeros(state.bodies.boxes.shape[:2], np.bool_)
        _look(
            state.live,
            self._cameras,
            state.sensors,
            state.bodies,
            state.outlines,
            reported,
            boxes,
            self._silent(state, boxes),
            seen,
            shown,
        )
        if self._is_late:
            return self._delay.newest(state.live, seen, state.sensors.poses[:, 3]), shown
        return seen, shown

    def _silent(self, state: BatchState, boxes: Floats) -> Mask:
        """(W, R) the reported bodies that are missed, or are there when all is dark."""
        silent: Mask = np.zeros(boxes.shape[:2], np.bool_)
        if self._misses.any:
            ranges = planar_ranges(boxes.reshape(-1, 7)).reshape(silent.shape)
            silent = self._misses.draw(state.live, ranges)
        if self._is_ever_dark:
            times = state.times.tolist()
            dark = [
                each.black_at(time_s) for each, time_s in zip(self._conditions, times, strict=True)
            ]
            silent |= np.array(dark)[:, None]
        return silent


@compiled(brief=True)
def _see_boxes(
    live: Mask, sensors: Sensors, bodies: Bodies, reported: Reported, boxes: Floats
) -> None:
    """Fill `boxes` (W, R, 7) with those of the reported bodies in the frames of the sensors."""
    for w in range(len(live)):
        if live[w]:
            count = reported.counts[w]
            for n in range(count):
                for k in range(boxes.shape[2]):
                    boxes[w, n, k] = bodies.boxes[w, reported.bodies[w, n], k]
            copy_rows(seen_by(sensors, w, boxes[w, :count]), boxes[w])


@compiled()
def _look(
    live: Mask,
    cameras: Cameras,
    sensors: Sensors,
    bodies: Bodies,
    outlines: Outlines,
    reported: Reported,
    boxes: Floats,
    silent: Mask,
    seen: Detected,
    shown: Mask,
) -> None:
    """See `Sight.look`; of the reported bodies that are `silent` (W, R) there is no detection."""
    room = _room(live, cameras, bodies, outlines)
    for w in range(len(live)):
        if not live[w]:
            continue
        parts = outlines.counts[w]
        meshes = Meshes(
            outlines.corners[w],
            outlines.faces[w],
            outlines.edges[w],
            outlines.starts[w],
            outlines.owners[w, :parts],
            outlines.reaches[w],
        )
        x, y, z, _, _, _ = sensors.poses[w]
        cos, sin = sensors.turns[w]
        classes = _told_classes(reported, w, bodies.counts[w], silent)
        count = 0
        for camera in range(len(cameras.sizes)):
            table = _photograph(
                cameras,
                camera,
                ((x, y, z), (cos, sin)),
                boxes[w, : reported.counts[w]],
                meshes,
                bodies.poses[w, : bodies.counts[w]],
                room,
            )
            for n in range(len(table)):
                shown[w, table[n, 0]] |= table[n, 5] >= MIN_PIXELS
            outlined = table[:, 1:5].astype(np.float64)
            rows, _ = reported_boxes(table[:, 0], outlined, table[:, 5], classes, camera)
            copy_rows(rows, seen.rows[w, count:])
            count += len(rows)
        rows = seen.rows[w, :count]
        surest, _ = surest_first(rows, np.empty(count, np.int64), cameras.least[w])
        copy_rows(surest, seen.rows[w])
        seen.counts[w] = len(surest)


@compiled()
def _room(live: Mask, cameras: Cameras, bodies: Bodies, outlines: Outlines) -> _Room:
    """Room for any picture of the worlds that are `live`."""
    parts, width, height = 0, 0, 0
    for w in range(len(live)):
        parts = max(parts, outlines.counts[w] if live[w] else 0)
    for camera in range(len(cameras.sizes)):
        width, height = max(width, cameras.sizes[camera, 0]), max(height, cameras.sizes[camera, 1])
    counts = parts, outlines.faces.shape[1], outlines.edges.shape[1]
    return _Room(
        room_for(counts, width, height),
        empty_line(width, _DEPTHS),
        np.empty((bodies.poses.shape[1], 6), np.int64),
    )


@compiled()
def _told_classes(reported: Reported, world: int, bodies: int, silent: Mask) -> Integers:
    """The class of every body of a world, -1 of those without one and those that are silent."""
    classes = reported.by_body[world, :bodies].copy()
    for n in range(reported.counts[world]):
        if silent[world, n]:
            classes[reported.bodies[world, n]] = -1
    return classes


@compiled()
def _photograph(
    cameras: Cameras,
    number: int,
    sensor: tuple[tuple[float, float, float], tuple[float, float]],
    boxes: Floats,
    meshes: Meshes,
    poses: Floats,
    room: _Room,
) -> Integers:
    """The table of what a camera shows around boxes (n, 7) in the frame of the sensor, whose place
    and turn are told.
    """
    model = model_of(cameras.models, number)
    width, height = cameras.sizes[number]
    window = window_on(boxes, model, NEAR_M, width, height)
    # As `PinholeCamera.stance` of an upright sensor.
    (x, y, z), turn = sensor
    mount = turned_alike(cameras.mounts[number], turn)
    place = np.array((x + mount[0, 0], y + mount[0, 1], z + mount[0, 2]))
    camera = PlacedCamera(place, mount[1:])
    lens = Lens(model.focal, model.centre[0], model.centre[1])
    lay_silhouettes(camera, lens, window, _DEPTHS, meshes, poses, room.seen)
    found = room.found[: len(poses)]
    no_picture = np.empty((0, 0), np.int64)
    return found[: draw_silhouettes(room.seen, window, _DEPTHS, room.line, found, no_picture)]
