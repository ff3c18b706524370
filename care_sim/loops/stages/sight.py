"""The cameras of all worlds, and the detections that arrive.

The engine `fast` draws the pictures (`care_sim.sensors.engines.picture_kernels`), and their
detectors report what is in them (`care_sim.sensors.camera`).
"""

from collections.abc import Mapping, Sequence

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.base.threads import Threads
from care_sim.core.arrays import Floats, Integers, Mask, longer
from care_sim.core.conditions import Sensing
from care_sim.core.frames import Frame, turned_alike
from care_sim.core.pinhole import (
    NEAR_M,
    MountedCameras,
    PinholeCamera,
    mounted_cameras,
    mounted_model,
    window_on,
)
from care_sim.core.rig import Rig
from care_sim.core.rows import copy_row
from care_sim.loops.stages.state import Bodies, Outlines, Reported, Sensors, State, seen_by
from care_sim.sensors.camera import CameraDetectors
from care_sim.sensors.camera_faults import Detected
from care_sim.sensors.engines import Engine, make_engine
from care_sim.sensors.engines.picture_kernels import Line, draw_silhouettes, empty_line
from care_sim.sensors.engines.silhouette_kernels import Silhouettes, lay_silhouettes, room_for
from care_sim.sensors.engines.view_kernels import Lens, Meshes, PlacedCamera
from care_sim.sensors.false_boxes import BoxPool
from care_sim.sensors.pictures import MIN_PIXELS, add_reported, faultless_detections
from care_sim.world.bullet import FAR_M, NO_BODY
from care_sim.world.world import WORLD_STEP_S, World

_DEPTHS = (NEAR_M, FAR_M)


_Room = tuple[Silhouettes, Line, Integers]
"""Room that one picture after the other is drawn in. The last is its table of boxes (B, 6)."""


class Seeing:
    """The cameras of all worlds, which differ in their `conditions` alone. Pictures are made on
    `threads`.

    Returned arrays are reused at the next keyframe.
    """

    def __init__(self, rig: Rig, conditions: Sequence[Sensing], threads: Threads):
        worlds = len(conditions)
        self._rig = rig
        self._threads = threads
        self._engine = conditions[0].engine
        self.is_fast = self._engine == "fast"
        self.detectors = CameraDetectors(
            conditions, rig.keyframe_s, rig.cameras, WORLD_STEP_S, threads
        )
        self.after_steps: Integers = np.rint(self.detectors.after_s / WORLD_STEP_S).astype(np.int64)
        """(W,) world steps from a keyframe to the pictures that it takes."""
        self._designed = mounted_cameras(worlds, rig.cameras)
        # By world, what draws with another engine, and the classes of the reported bodies.
        self._drawers: dict[int, tuple[Engine, Mapping[int, int]]] = {}
        # Bodies of whom somebody asks at every keyframe, whether a camera shows them.
        self._asked = np.full((worlds, 1), NO_BODY)
        self._asks_few = np.zeros(worlds, np.bool_)
        self._shown = np.zeros((worlds, 0), np.bool_)
        self._shows_all = np.zeros(worlds, np.bool_)

    def begin(self, world: int, built: World, seed: np.random.SeedSequence, pool: BoxPool) -> None:
        """Begin an episode; `seed` is that of the camera (`care_sim.loops.episode.SensorSeeds`).
        False boxes are made from the `pool`.
        """
        labels = built.labels()
        self.detectors.begin(world, [*labels], seed, pool)
        if not self.is_fast:
            self._drawers[world] = make_engine(self._engine, built.bullet, self._rig.grid), labels
        target = built.first_sighting
        # The target is often one of those that the ego meets.
        asked = list({one.body for one in (*built.meetings, target) if one is not None})
        if len(asked) > self._asked.shape[1]:
            self._asked = longer(self._asked, len(asked), empty=NO_BODY)
        self._asked[world] = NO_BODY
        self._asked[world, : len(asked)] = asked
        # The pictures hold what is reported, and others by chance.
        self._asks_few[world] = self.after_steps[world] > 0 and labels.keys() >= set(asked)

    def look(self, state: State) -> tuple[Detected, Mask]:
        """Take the pictures of a keyframe. Return the newest detections that are due, and (W, B)
        which bodies a camera shows enough of for a box. Only those that somebody asks about are
        sure to be known.
        """
        live = state.live
        _see_boxes(live, state.sensors, state.bodies, state.reported)
        # The other worlds keep what was shown at their last keyframe.
        if self._shown.shape != state.bodies.boxes.shape[:2]:
            self._shown = longer(self._shown, state.bodies.boxes.shape[1])
        self._shown[live] = False

        # Where the detectors' pictures are taken between keyframes, those asked about are looked
        # for. Elsewhere the pictures show who is there.
        few = live & self._asks_few & self.is_fast
        self._shows_all[live] = ~few[live]
        seen = self._drawn(state, live & ~few, False)
        if few.any():
            tables = state.sensors, state.bodies, state.outlines
            self._threads.share(_look_for, few, self._asked, self._designed, *tables, self._shown)
        now = live & (self.after_steps == 0)
        if now.any():
            self._take(state, now, seen)
        return self.detectors.newest(live, state.taken.poses[:, 3]), self._shown

    def look_between(self, state: State, due: Mask) -> None:
        """Take the pictures of the worlds that are `due`, after some of their steps."""
        _see_boxes(due, state.sensors, state.bodies, state.reported)
        self._take(state, due)

    def shows(self, state: State, world: int, body: int) -> bool:
        """Whether a camera shows enough of a body for a box, at a world's coming keyframe."""
        if not self._shows_all[world] and body not in self._asked[world]:
            self._drawn(state, np.arange(state.worlds) == world, False)
            self._shows_all[world] = True
        return bool(self._shown[world, body])

    def _take(self, state: State, due: Mask, seen: Detected | None = None) -> None:
        """Hand the detectors their pictures; `seen` is what cameras show where no mount errs."""
        drawn = due if seen is None else due & self.detectors.errs
        if seen is None or drawn.any():
            seen = self._drawn(state, drawn, True, seen)
        headings, boxes = state.taken.poses[:, 3], state.reported.boxes
        self.detectors.take(due, seen, headings, boxes, state.times)

    def _drawn(
        self, state: State, who: Mask, are_mounted: bool, seen: Detected | None = None
    ) -> Detected:
        """Draw the pictures of the worlds `who`: write their faultless detections into `seen`, by
        default a new table. Cameras are as mounted, or as designed; these note who is shown.
        """
        reported = state.reported
        if seen is None:
            seen = Detected.of(state.worlds, len(self._rig.cameras) * reported.boxes.shape[1])
        if not who.any():
            return seen
        cameras = self.detectors.cameras if are_mounted else self._designed
        # An event between two keyframes may have added bodies.
        shown = np.zeros(state.bodies.boxes.shape[:2], np.bool_) if are_mounted else self._shown
        if self.is_fast:
            tables = state.sensors, state.bodies, state.outlines, reported
            self._threads.share(_look, who, cameras, *tables, seen, shown)
            return seen
        # Another engine draws its own pictures, world by world.
        for world in np.flatnonzero(who).tolist():
            engine, labels = self._drawers[world]
            made = self.detectors.mounted[world] if are_mounted else self._rig.cameras
            boxes = reported.boxes[world, : reported.counts[world]].copy()
            drawn = photographed(engine, made, state.sensors.frame(world), boxes)
            large = [row[0] for table in drawn for row in table if row[5] >= MIN_PIXELS]
            shown[world, large] = True
            seen = seen.put(world, faultless_detections(drawn, labels))
        return seen


def photographed(
    engine: Engine, cameras: Sequence[PinholeCamera], sensor: Frame, boxes: Floats
) -> list[Integers]:
    """Return the table of boxes (`care_sim.sensors.pictures`) of each camera, as an engine draws
    it. `boxes` (n, 7), in the sensor frame, hold all that a detector may ever report.
    """
    return [engine.visible_boxes(one, sensor, one.window_on(boxes)) for one in cameras]


@compiled(brief=True)
def _see_boxes(live: Mask, sensors: Sensors, bodies: Bodies, reported: Reported) -> None:
    """Fill the boxes of the reported bodies."""
    for w in range(len(live)):
        if live[w]:
            boxes = reported.boxes[w, : reported.counts[w]]
            for n in range(len(boxes)):
                copy_row(bodies.boxes[w, reported.bodies[w, n]], boxes[n])
            seen = seen_by(sensors, w, boxes)
            for n in range(len(boxes)):
                copy_row(seen[n], boxes[n])


@compiled()
def _look(
    live: Mask,
    cameras: MountedCameras,
    sensors: Sensors,
    bodies: Bodies,
    outlines: Outlines,
    reported: Reported,
    seen: Detected,
    shown: Mask,
) -> None:
    """Draw the pictures around the reported bodies; see `Seeing._drawn`."""
    room = _room(live, cameras, bodies, outlines)
    for w in range(len(live)):
        if not live[w]:
            continue
        classes = reported.by_body[w, : bodies.counts[w]]
        boxes = reported.boxes[w, : reported.counts[w]]
        count = 0
        for camera in range(len(cameras.sizes)):
            table = _photograph(cameras, w, camera, sensors, boxes, bodies, outlines, room)
            for n in range(len(table)):
                shown[w, table[n, 0]] |= table[n, 5] >= MIN_PIXELS
            rows, objects = seen.rows[w], seen.objects[w]
            count = add_reported(table, classes, camera, rows, objects, count)
        seen.counts[w] = count


@compiled()
def _look_for(
    live: Mask,
    asked: Integers,
    cameras: MountedCameras,
    sensors: Sensors,
    bodies: Bodies,
    outlines: Outlines,
    shown: Mask,
) -> None:
    """Note which of the bodies `asked` (W, A), padded with NO_BODY, are `shown` (W, B)."""
    room = _room(live, cameras, bodies, outlines)
    box = np.empty((1, 7))
    for w in range(len(live)):
        for body in asked[w]:
            if not live[w] or body == NO_BODY:
                continue
            copy_row(bodies.boxes[w, body], box[0])
            around = seen_by(sensors, w, box)
            for camera in range(len(cameras.sizes)):
                table = _photograph(cameras, w, camera, sensors, around, bodies, outlines, room)
                for n in range(len(table)):
                    shown[w, body] |= table[n, 0] == body and table[n, 5] >= MIN_PIXELS


@compiled()
def _room(live: Mask, cameras: MountedCameras, bodies: Bodies, outlines: Outlines) -> _Room:
    """Room for any picture of the worlds that are `live`."""
    parts, width, height = 0, 0, 0
    for w in range(len(live)):
        parts = max(parts, outlines.counts[w] if live[w] else 0)
    for camera in range(len(cameras.sizes)):
        width, height = max(width, cameras.sizes[camera, 0]), max(height, cameras.sizes[camera, 1])
    counts = parts, outlines.meshes.faces.shape[1], outlines.meshes.edges.shape[1]
    found = np.empty((bodies.poses.shape[1], 6), np.int64)
    return room_for(counts, width, height), empty_line(width, _DEPTHS), found


@compiled()
def _photograph(
    cameras: MountedCameras,
    world: int,
    number: int,
    sensors: Sensors,
    boxes: Floats,
    bodies: Bodies,
    outlines: Outlines,
    room: _Room,
) -> Integers:
    """Return the table of the bodies that a camera shows around boxes (n, 7), in the frame of the
    world's sensor. A window in which nobody can show MIN_PIXELS stays empty.
    """
    poses, parts = bodies.poses[world, : bodies.counts[world]], outlines.counts[world]
    seen, line, found = room[0], room[1], room[2][: len(poses)]
    model = mounted_model(cameras, world, number)
    width, height = cameras.sizes[number]
    window = window_on(boxes, model, NEAR_M, width, height)
    if (window[2] - window[0]) * (window[3] - window[1]) < MIN_PIXELS:
        return found[:0]
    corners, faces, edges, starts, owners, reaches = outlines.meshes
    meshes = Meshes(
        corners[world],
        faces[world],
        edges[world],
        starts[world],
        owners[world, :parts],
        reaches[world],
    )
    # As `PinholeCamera.stance` of an upright sensor.
    cos, sin = sensors.turns[world]
    mount = turned_alike(cameras.mounts[world, number], (cos, sin))
    place = sensors.poses[world, :3] + mount[0]
    camera = PlacedCamera(place, mount[1:])
    lens = Lens(model.focal, model.centre[0], model.centre[1])
    lay_silhouettes(camera, lens, window, _DEPTHS, meshes, poses, seen)
    no_picture = np.empty((0, 0), np.int64)
    return found[: draw_silhouettes(seen, window, _DEPTHS, line, found, no_picture)]
