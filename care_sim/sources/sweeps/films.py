"""Films of logs without labels. Camera boxes are those that a 2D detector reported on their
pictures.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.sensor_setup import SensorSetup
from care_sim.core.types import CLASSES, Detections, ImageDetections
from care_sim.loops.film import Film, Shot
from care_sim.loops.gathering import acted_on
from care_sim.perception.cluster.points import SETTLING_M
from care_sim.perception.detectors import CLUSTER, PRIVILEGED, check_detector, make_detector
from care_sim.perception.tracker import MemoryRules, TrackMemory
from care_sim.sensors.annotated import (
    NO_ANNOTATIONS,
    Annotations,
    IdentifiedDetections,
)
from care_sim.sensors.camera import NOTHING_SEEN
from care_sim.sensors.surround import SURROUND_CAMERAS
from care_sim.sources.box_films import motions
from care_sim.sources.film_checks import LEAST_KEYFRAMES, report_once
from care_sim.sources.nuscenes.detections import DetectionFile, Found, objects_behind
from care_sim.sources.nuscenes.sweeps import recorded_cloud
from care_sim.sources.sweeps.logs import SWEEPS_KEYFRAME_S, Log
from care_sim.sources.sweeps.points import in_seconds
from care_sim.world.bodies import CATALOGUE

STABLE_KEYFRAMES = 3
"""The paper counts stable entries. The gate of the third detection is the first narrow one, since
the track then has a velocity.
"""
_RULES = MemoryRules(coast_s=SWEEPS_KEYFRAME_S)
"""A track outlives one missed keyframe. After more, its gate holds clusters of something else."""


def check_reference(name: str) -> None:
    """Raise InvalidInput for no detector, and for one that needs annotations itself."""
    check_detector(name)
    if name in PRIVILEGED:
        raise InvalidInput(f"reference must be a detector that sees points alone, got {name}")


def reference(
    sweeps: Sequence[Floats],
    sensors: Sequence[Frame],
    detector: str,
    grid: AngularGrid,
    sensor_height_m: float,
) -> list[Annotations]:
    """Return the annotations of every keyframe, from its points (n, 5) in the frame of its sensor.

    The `detector` gets the full scan of every keyframe. Detections are tracked by place alone,
    since the class of a cluster changes with its view. An object is annotated at the keyframes at
    which it is detected, if these are at least `STABLE_KEYFRAMES`, with the class that it has most
    often.
    """
    made = make_detector(detector, sensor_height_m, **{"grid": grid} if detector == CLUSTER else {})
    memory = TrackMemory(SWEEPS_KEYFRAME_S, _RULES)
    found: list[Detections] = []
    tracks: list[Integers] = []
    for points, sensor in zip(sweeps, sensors, strict=True):
        cloud = recorded_cloud(points, grid, NO_ANNOTATIONS, sensor)
        reported, _ = made.detect(cloud, NO_ANNOTATIONS)
        detections = reported.take(acted_on(reported, made.track_score))
        alike = replace(detections, classes=np.zeros(len(detections), np.int64))
        found.append(detections)
        tracks.append(memory.update(alike, sensor))
        memory.predict()
    counts = np.zeros((max((ids.max(initial=-1) for ids in tracks)) + 1, len(CLASSES)), np.int64)
    for detections, ids in zip(found, tracks, strict=True):
        np.add.at(counts, (ids, detections.classes), 1)
    stable, classes = counts.sum(axis=1) >= STABLE_KEYFRAMES, counts.argmax(axis=1)
    return [
        Annotations(ids[stable[ids]], classes[ids[stable[ids]]], detections.boxes[stable[ids]])
        for detections, ids in zip(found, tracks, strict=True)
    ]


BOXES_FILE = "camera_boxes.json"
_ROAD_M = (3.0, 12.0)
"""Returns so far away are those of the road where they are lowest."""
_LEAST_HEIGHT_M = 0.5
_BIN_M = 0.1
_AROUND_CAR_M = 0.3
"""Mirrors, racks and aerials reach so far beyond the body."""


def film_of_log(log: Log, setup: SensorSetup, detector: str, boxes: Path | None) -> Film:
    """Return the film of a log, annotated by `detector` (`care_sim.sources.sweeps.films`).

    The points of a sweep are in the axes of the LiDAR, as `setup` says that it is mounted. Camera
    boxes come from the file `boxes`. Without them the film has cameras that report nothing, and a
    line says so.

    Raises InvalidInput for a set-up of several LiDARs, for a road that is not where the set-up has
    it, and as the parts do.
    """
    grid = setup.grid
    if not isinstance(grid, AngularGrid):
        raise InvalidInput(f"{log.source}: sweeps are of one LiDAR, {setup.name} has several")
    rows = log.keyframes()
    if len(rows) < LEAST_KEYFRAMES:
        raise InvalidInput(
            f"{log.source}: a film needs {LEAST_KEYFRAMES} keyframes, {SWEEPS_KEYFRAME_S:g} s "
            f"apart, and the sweeps are enough for {len(rows)}"
        )
    # The motion of the car is fitted to the poses of all sweeps.
    cars = log.cars(log.times_s)
    egos = motions(log.times_s, cars)
    mount = Rotation.from_euler("ZYX", [grid.heading, -grid.pitch, grid.roll])
    sweeps = [_off_the_car(_turned(mount, log.points_of(row)), setup) for row in rows.tolist()]
    _check_height(log, setup, sweeps)
    sensors = [cars[row].holding(np.array(setup.position)) for row in rows.tolist()]
    height_m = setup.position[2]
    annotated = reference(sweeps, sensors, detector, grid, height_m)
    cameras = CameraBoxes(boxes, setup.cameras, log) if boxes else None
    if cameras is None:
        report_once(
            f"{log.source}: no {BOXES_FILE}: the camera reports nothing, so CARE has no residual"
        )
    shots = []
    for row, points, sensor, annotations in zip(
        rows.tolist(), sweeps, sensors, annotated, strict=True
    ):
        time_s = log.times_s[row]
        seen = cameras.seen(time_s, cars[row], annotations) if cameras else NOTHING_SEEN
        cloud = recorded_cloud(points, grid, annotations, sensor)
        from_start = float(time_s - log.times_s[0])
        token = f"{log.name}/{row}"
        shots.append(Shot(from_start, token, sensor, egos[row], annotations, seen, cloud))
    return Film(
        log.name,
        setup.equipped(SURROUND_CAMERAS),
        height_m,
        SWEEPS_KEYFRAME_S,
        tuple(shots),
        NO_ANNOTATIONS,
        grid,
        setup.position[:2],
        detected=cameras is not None,
    )


def _turned(mount: Rotation, points: Floats) -> Floats:
    """Return points (n, 5) in the sensor frame of which the axes of the LiDAR are turned."""
    return np.column_stack([mount.apply(points[:, :3]), points[:, 3:]])


def _off_the_car(points: Floats, setup: SensorSetup) -> Floats:
    """Return the points (n, 5) that do not lie on the recording car, which would be an object."""
    x, y, _ = setup.position
    length, width, _ = CATALOGUE["ego"].size
    ahead, left = np.abs(points[:, :2] + (x, y)).T
    kept: Floats = points[(ahead > length / 2 + _AROUND_CAR_M) | (left > width / 2 + _AROUND_CAR_M)]
    return kept


def _check_height(log: Log, setup: SensorSetup, sweeps: Sequence[Floats]) -> None:
    """Raise InvalidInput where the road does not lie as far below the LiDAR as the set-up says.

    The detector looks for the road there, and would take it for objects.
    """
    # Ten seconds are enough, and all points of a long log would not fit into memory twice.
    points = np.concatenate(sweeps[:20])
    ranges = np.hypot(*points[:, :2].T)
    low = (ranges > _ROAD_M[0]) & (ranges < _ROAD_M[1]) & (points[:, 2] < -_LEAST_HEIGHT_M)
    heights = -points[low, 2]
    if not len(heights):
        raise InvalidInput(
            f"{log.source}: no returns below the LiDAR within {_ROAD_M[1]:g} m; z must point up"
        )
    # The densest height. A mean would be drawn up by what stands on the road.
    bins = np.bincount((heights / _BIN_M).astype(np.int64))
    near = np.abs(heights - (bins.argmax() + 0.5) * _BIN_M) <= _BIN_M
    measured, told = float(np.median(heights[near])), setup.position[2]
    if abs(measured - told) > SETTLING_M:
        raise InvalidInput(
            f"{log.source}: the road lies {measured:.2f} m below the LiDAR, and position_m of the "
            f"set-up {setup.name} says {told:g}; describe the LiDAR in a set-up file sensor.toml"
        )


class CameraBoxes:
    """The boxes of a file in a form of `care_sim.sources.nuscenes.detections`. A picture is named
    CAMERA/TIME: the number of its camera in the set-up, from 0, and the time as that of a sweep.

    At a keyframe counts the newest picture of each camera that has boxes, up to half a second old,
    with its age and the car's turn since.
    """

    def __init__(self, path: Path, cameras: tuple[PinholeCamera, ...], log: Log):
        self._cameras, self._log = cameras, log
        pictures: dict[int, list[tuple[float, list[Found]]]] = defaultdict(list)
        for name, boxes in DetectionFile(path).pictures.items():
            camera, _, time = name.partition("/")
            try:
                pictures[int(camera[:9])].append((float(time), boxes))
            except ValueError as error:
                raise InvalidInput(
                    f"{path}: the picture {name!r:.100} must be named CAMERA/TIME, as 0/12.5"
                ) from error
        if any(not 0 <= number < len(cameras) for number in pictures):
            raise InvalidInput(
                f"{path}: cameras must be numbers from 0 on of the {len(cameras)} [[cameras]] in "
                f"the set-up, got {sorted(pictures)}"
            )
        self._pictures = {}
        for number, taken in pictures.items():
            taken.sort(key=lambda picture: picture[0])
            times = in_seconds(np.array([time for time, _ in taken]))
            self._pictures[number] = times, [boxes for _, boxes in taken]

    def seen(self, time_s: float, car: Frame, annotations: Annotations) -> IdentifiedDetections:
        """Return the boxes at a keyframe, each with the object that it lies on."""
        rows = [np.empty((0, len(ImageDetections.COLUMNS)))]
        objects = [np.empty(0, np.int64)]
        for number, (times, pictures) in self._pictures.items():
            newest = int(np.searchsorted(times, time_s, side="right")) - 1
            if newest < 0 or time_s - times[newest] > SWEEPS_KEYFRAME_S:
                continue
            found = pictures[newest]
            boxes = np.array([box for _, _, box in found])
            classes = np.array([label for label, _, _ in found], np.int64)
            # A picture may be older than the first pose.
            taken = np.clip(times[newest : newest + 1], *self._log.poses[[0, -1], 0])
            (then,) = self._log.cars(taken)
            turn = (car.yaw - then.yaw + np.pi) % (2 * np.pi) - np.pi
            told = np.tile([number, time_s - times[newest], turn], (len(found), 1))
            rows.append(np.column_stack([classes, [sure for _, sure, _ in found], boxes, told]))
            camera = self._cameras[number]
            limits = np.array([camera.width, camera.height] * 2)
            spans = np.nan_to_num(camera.project_boxes(annotations.boxes))
            objects.append(objects_behind(boxes, classes, np.clip(spans, 0, limits), annotations))
        return IdentifiedDetections(
            ImageDetections.from_rows(np.concatenate(rows)), np.concatenate(objects)
        )
