"""The cameras of all worlds, and the detections that arrive.

The engine `fast` draws the pictures (`care_sim.sensors.engines.picture_kernels`), and an ideal
camera detects (`care_sim.sensors.camera`). This camera may miss bodies, be late and black, and
takes its pictures at keyframes. Other cameras have a detector of their own, world by world.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_sim.base.compiled import compiled
from care_sim.base.threads import Threads
from care_sim.core.arrays import Floats, Integers, Mask, longer
from care_sim.core.cells.boxes import planar_ranges
from care_sim.core.conditions import IDEAL_CAMERA, CameraFaults, Sensing
from care_sim.core.frames import Frame, turned_alike
from care_sim.core.pinhole import NEAR_M, CameraModels, PinholeCamera, model_of, window_on
from care_sim.core.rig import Rig
from care_sim.loops.stages.state import Bodies, Outlines, Reported, Sensors, State, seen_by
from care_sim.sensors.annotated import IdentifiedDetections
from care_sim.sensors.camera import CameraDetector, picture_timing
from care_sim.sensors.camera_faults import Delay, Detected, Misses
from care_sim.sensors.engines import Engine, make_engine
from care_sim.sensors.engines.picture_kernels import Line, draw_silhouettes, empty_line
from care_sim.sensors.engines.silhouette_kernels import (
    Silhouettes,
    lay_silhouettes,
    room_for,
)
from care_sim.sensors.engines.view_kernels import Lens, Meshes, PlacedCamera
from care_sim.sensors.false_boxes import BoxPool
from care_sim.sensors.pictures import (
    MIN_PIXELS,
    class_table,
    faultless_detections,
    reported_boxes,
    sort_by_confidence,
)
from care_sim.world.bullet import FAR_M
from care_sim.world.world import WORLD_STEP_S, World

_DEPTHS = (NEAR_M, FAR_M)


class Cameras(NamedTuple):
    """The k cameras of a rig and their `models`. `mounts` (k, 4, 3) are place and axes in the
    sensor frame; `sizes` (k, 2) are width and height in pixels. `least` (W,) is the least
    confidence of a box per world. `unsorted` (W,) says whether detections stay unsorted, for a
    detector to come.
    """

    models: CameraModels
    mounts: Floats
    sizes: Integers
    least: Floats
    unsorted: Mask


class _Room(NamedTuple):
    """Room that one picture after the other is drawn in; `found` (B, 6) is its table of boxes."""

    seen: Silhouettes
    line: Line
    found: Integers


def has_own_detector(conditions: Sensing) -> bool:
    """Whether a camera has faults or a detector of which compiled code knows nothing."""
    return (
        conditions.engine != "fast"
        or conditions.camera_profile != IDEAL_CAMERA
        or bool(
            conditions.false_positive_rate
            or conditions.camera_latency_s
            or conditions.camera_rotation_sigma_deg
            or conditions.camera_position_sigma_m
        )
    )


class Seeing:
    """The cameras of all worlds, which differ in their `conditions` alone. Pictures are made on
    `threads`.

    Returned arrays are reused at the next keyframe.
    """

    def __init__(self, rig: Rig, conditions: Sequence[Sensing], threads: Threads):
        models = rig.camera_models
        self._rig = rig
        self._threads = threads
        self._conditions = conditions
        self.own = np.array([has_own_detector(each) for each in conditions])
        """(W,) where detections come from a `CameraDetector` of the world."""
        self.own_cameras: dict[int, OwnCameras] = {}
        """Their cameras, by world."""
        self.between: dict[int, int] = {}
        """Worlds whose pictures are taken between keyframes, and how many world steps after."""
        self._cameras = Cameras(
            models,
            np.concatenate([models.positions[:, None], models.axes], axis=1),
            np.array([(camera.width, camera.height) for camera in rig.cameras]).reshape(-1, 2),
            np.array([float(each.camera_confidence) for each in conditions]),
            self.own,
        )
        # The faults of own detectors are theirs alone.
        alike = [
            CameraFaults() if own else each for own, each in zip(self.own, conditions, strict=True)
        ]
        timings = [picture_timing(each, rig.keyframe_s, WORLD_STEP_S) for each in alike]
        latencies = np.array([timing.keyframes for timing in timings])
        jitters = np.array([each.camera_jitter for each in alike])
        self._misses = Misses(alike)
        self._delay = Delay(latencies, jitters, rig.keyframe_s)
        self._is_late = bool(latencies.any() or jitters.any())
        self._faults = alike
        self._is_fast = conditions[0].engine == "fast"
        self._is_ever_dark = any(each.blackout_s for each in alike)
        self._shown = np.zeros((len(conditions), 0), np.bool_)

    def begin(self, world: int, built: World, seed: np.random.SeedSequence, pool: BoxPool) -> None:
        """Begin an episode; `seed` is that of the camera (`care_sim.loops.episode.SensorSeeds`).
        False boxes are made from the `pool`.
        """
        if self.own[world]:
            given = self._rig, self._conditions[world], seed, pool
            own = self.own_cameras[world] = OwnCameras(built, *given)
            if own.after_steps:
                self.between[world] = own.after_steps
            return
        self._misses.begin(world, seed, len(built.labels()))
        if self._is_late:
            # The streams are those of `care_sim.sensors.camera.CameraDetector`.
            _, delay, *_ = seed.spawn(7)
            self._delay.begin(world, delay)

    def look(self, state: State) -> tuple[Detected, Mask]:
        """Take the pictures of a keyframe: the newest detections that are due, and (W, B) which
        bodies a camera shows enough of for a box.
        """
        reported = state.reported
        _see_boxes(state.live, state.sensors, state.bodies, reported)
        boxes = reported.boxes
        seen = Detected.of(state.worlds, len(self._cameras.sizes) * boxes.shape[1])
        # The other worlds keep what was shown at their last keyframe.
        if self._shown.shape != state.bodies.boxes.shape[:2]:
            self._shown = longer(self._shown, state.bodies.boxes.shape[1])
        shown = self._shown
        shown[state.live] = False
        # Another engine draws its own pictures, world by world.
        self._threads.share(
            _look,
            state.live & self._is_fast,
            self._cameras,
            state.sensors,
            state.bodies,
            state.outlines,
            reported,
            self._silent(state, boxes),
            seen,
            shown,
        )
        if self._is_late:
            whose, headings = state.live & ~self.own, state.taken.poses[:, 3]
            self._delay.take(whose, seen, headings)
            arrived = self._delay.newest(whose, headings)
        else:
            arrived = seen
        for world in np.flatnonzero(state.live & self.own).tolist():
            at = state, world, boxes[world, : reported.counts[world]].copy()
            own = self.own_cameras[world].look(at, seen.take(world), shown[world])
            arrived = arrived.put(world, own)
        return arrived, shown

    def look_between(self, state: State, world: int) -> None:
        """Take the pictures of a world after some of its steps."""
        bodies = state.reported.bodies[world, : state.reported.counts[world]]
        boxes = seen_by(state.sensors, world, state.bodies.boxes[world, bodies])
        self.own_cameras[world].take((state, world, boxes))

    def _silent(self, state: State, boxes: Floats) -> Mask:
        """(W, R) the reported bodies that are missed, or are there when all is dark."""
        silent: Mask = np.zeros(boxes.shape[:2], np.bool_)
        if self._misses.any:
            ranges = planar_ranges(boxes.reshape(-1, 7)).reshape(silent.shape)
            silent = self._misses.draw(state.live, ranges)
        if self._is_ever_dark:
            times = state.times.tolist()
            dark = [each.black_at(at) for each, at in zip(self._faults, times, strict=True)]
            silent |= np.array(dark)[:, None]
        return silent


class OwnCameras:
    """The cameras of one world with a `CameraDetector`, whose mounts may err."""

    def __init__(
        self,
        world: World,
        rig: Rig,
        sensing: Sensing,
        seed: np.random.SeedSequence,
        pool: BoxPool,
    ):
        labels = world.labels()
        self._designed = rig.cameras
        self._classes = class_table(labels)
        self._is_fast = sensing.engine == "fast"
        self._engine = make_engine(sensing.engine, world.bullet, rig.grid)
        self.detector = CameraDetector(
            list(labels), sensing, rig.keyframe_s, seed, rig.cameras, pool, step_s=WORLD_STEP_S
        )
        self.after_steps = round(self.detector.timing.after_s / WORLD_STEP_S)
        """World steps from a keyframe to the pictures that the detector is given."""

    def look(
        self, at: tuple[State, int, Floats], seen: IdentifiedDetections, shown: Mask
    ) -> IdentifiedDetections:
        """Take the pictures of a keyframe: the newest detections that are due. `seen` and `shown`
        (B,) are of the engine `fast`; of another `shown` is written anew.
        """
        state, world, boxes = at
        if not self._is_fast:
            sensor = state.sensors.frame(world)
            tables = photographed(self._engine, self._designed, sensor, boxes)
            shown[:] = False
            shown[[row[0] for table in tables for row in table if row[5] >= MIN_PIXELS]] = True
            seen = faultless_detections(tables, self._classes)
        if not self.after_steps:
            self.take(at, seen if self.detector.mounted == self._designed else None)
        return self.detector.newest(float(state.taken.poses[world, 3]))

    def take(self, at: tuple[State, int, Floats], seen: IdentifiedDetections | None = None) -> None:
        """Hand the detector its pictures; `seen` is what they show, where that is known."""
        state, world, boxes = at
        if seen is None:
            sensor = state.sensors.frame(world)
            tables = photographed(self._engine, self.detector.mounted, sensor, boxes)
            seen = faultless_detections(tables, self._classes)
        heading, time_s = state.taken.poses[world, 3], state.times[world]
        self.detector.take(seen, float(heading), boxes, float(time_s))


def photographed(
    engine: Engine, cameras: Sequence[PinholeCamera], sensor: Frame, boxes: Floats
) -> list[Integers]:
    """Return the table of boxes (`care_sim.sensors.pictures`) of each camera, as an engine draws
    it. `boxes` (n, 7), in the sensor frame, hold all that a detector may ever report.
    """
    return [engine.visible_boxes(one, sensor, one.window_on(boxes)) for one in cameras]


@compiled(brief=True)
def _copy_rows(rows: Floats, into: Floats) -> None:
    """Copy `rows` (n, k) to the first n rows of `into` (m, k).

    An assignment of slices does the same, but Numba compiles the text of its error along, which
    takes seconds.
    """
    for n in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            into[n, k] = rows[n, k]


@compiled(brief=True)
def _copy(numbers: NDArray[Any], into: NDArray[Any]) -> None:
    """Copy `numbers` (n,) to the first n of `into`, as `_copy_rows` does."""
    for n in range(len(numbers)):
        into[n] = numbers[n]


@compiled(brief=True)
def _see_boxes(live: Mask, sensors: Sensors, bodies: Bodies, reported: Reported) -> None:
    """Fill the boxes of the reported bodies."""
    for w in range(len(live)):
        if live[w]:
            boxes = reported.boxes[w, : reported.counts[w]]
            for n in range(len(boxes)):
                _copy(bodies.boxes[w, reported.bodies[w, n]], boxes[n])
            _copy_rows(seen_by(sensors, w, boxes), boxes)


@compiled()
def _look(
    live: Mask,
    cameras: Cameras,
    sensors: Sensors,
    bodies: Bodies,
    outlines: Outlines,
    reported: Reported,
    silent: Mask,
    seen: Detected,
    shown: Mask,
) -> None:
    """See `Seeing.look`; of the reported bodies that are `silent` (W, R) there is no detection."""
    room = _room(live, cameras, bodies, outlines)
    for w in range(len(live)):
        if not live[w]:
            continue
        parts = outlines.counts[w]
        corners, faces, edges, starts, owners, reaches = outlines.meshes
        meshes = Meshes(corners[w], faces[w], edges[w], starts[w], owners[w, :parts], reaches[w])
        x, y, z, _, _, _ = sensors.poses[w]
        cos, sin = sensors.turns[w]
        classes = _told_classes(reported, w, bodies.counts[w], silent)
        count = 0
        for camera in range(len(cameras.sizes)):
            table = _photograph(
                cameras,
                camera,
                ((x, y, z), (cos, sin)),
                reported.boxes[w, : reported.counts[w]],
                meshes,
                bodies.poses[w, : bodies.counts[w]],
                room,
            )
            for n in range(len(table)):
                shown[w, table[n, 0]] |= table[n, 5] >= MIN_PIXELS
            rows, objects = reported_boxes(table, classes, camera)
            _copy_rows(rows, seen.rows[w, count:])
            _copy(objects, seen.objects[w, count:])
            count += len(rows)
        if not cameras.unsorted[w]:
            rows, objects = seen.rows[w, :count], seen.objects[w, :count]
            surest, objects = sort_by_confidence(rows, objects, cameras.least[w])
            _copy_rows(surest, seen.rows[w])
            _copy(objects, seen.objects[w])
            count = len(surest)
        seen.counts[w] = count


@compiled()
def _room(live: Mask, cameras: Cameras, bodies: Bodies, outlines: Outlines) -> _Room:
    """Room for any picture of the worlds that are `live`."""
    parts, width, height = 0, 0, 0
    for w in range(len(live)):
        parts = max(parts, outlines.counts[w] if live[w] else 0)
    for camera in range(len(cameras.sizes)):
        width, height = max(width, cameras.sizes[camera, 0]), max(height, cameras.sizes[camera, 1])
    counts = parts, outlines.meshes.faces.shape[1], outlines.meshes.edges.shape[1]
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
    """Return the table of the bodies that a camera shows around boxes (n, 7), in the frame of the
    sensor, which is given by place and turn.
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
