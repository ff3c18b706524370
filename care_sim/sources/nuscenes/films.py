"""nuScenes scenes as films: recorded sweeps, annotations of the 2 Hz keyframes, six recorded
cameras.

A scene without any recorded sweep is played on its boxes, like Argoverse 2 logs. All boxes become
bodies, also those outside the five classes. Rays are cast at the bodies, and the recorded cameras
render them. Static surroundings are not annotated, so only boxes occlude.

Boxes without a LiDAR or radar point inside are left out, as in the official evaluation. Such boxes
of the first keyframe are in `Film.hidden`, since the objects were present. They are no bodies
either: their place is not measured, and a ray would hit objects that the LiDAR did not reach. With
`empty_boxes` they are annotated, and bodies.

The car's motion is that of the keyframes' poses. Pictures are taken within 50 ms of the sweep
(`care_sim.sources.nuscenes.cameras`).
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Mask
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.core.types import CLASSES, Ego
from care_sim.loops.film import Film, Shot
from care_sim.sensors.annotated import NO_OBJECT, Annotations, Cloud, IdentifiedDetections
from care_sim.sources.box_films import AnnotatedBody, motions, sense
from care_sim.sources.film_checks import AWAY_M, SIZES_M, report_empty_boxes, report_once
from care_sim.sources.nuscenes.cameras import (
    OWN,
    VISIBLE_SHARES,
    RecordedCamera,
    camera_of,
    frame_of,
    lidar_mount,
    pictures_of,
    projected_detections,
)
from care_sim.sources.nuscenes.categories import UnknownCategory, class_of
from care_sim.sources.nuscenes.detections import DetectionFile
from care_sim.sources.nuscenes.sweeps import (
    earlier,
    read_points,
    recorded_cloud,
    with_earlier_sweeps,
)
from care_sim.sources.nuscenes.table_files import JsonRow
from care_sim.sources.nuscenes.tables import CAMERA_CHANNELS, LIDAR, Database


def class_name(database: Database, box: JsonRow) -> str | None:
    """The class of a box, None outside the five."""
    token = database.row("instance", box["instance_token"])["category_token"]
    try:
        return class_of(database.row("category", token)["name"])
    except UnknownCategory as error:
        raise InvalidInput(f"{database.path('category')}: {token!r}: {error}") from None


def object_numbers(database: Database, samples: list[JsonRow]) -> dict[str, int]:
    """A number for every instance of a scene."""
    tokens = {
        box["instance_token"] for sample in samples for box in database.annotations(sample["token"])
    }
    # Sorted: the order of a set differs from process to process.
    return {token: number for number, token in enumerate(sorted(tokens))}


def annotations_of(
    database: Database, boxes: Sequence[JsonRow], numbers: dict[str, int], sensor: Frame
) -> Annotations:
    """Boxes of the five classes as annotations in the frame of the LiDAR.

    Raises InvalidInput for a box farther from it than any recording has one.
    """
    frames = [frame_of(database, "sample_annotation", box) for box in boxes]
    rows = [
        (*frame.origin.tolist(), *_size(database, box), frame.yaw)
        for frame, box in zip(frames, boxes, strict=True)
    ]
    classes = [CLASSES.index(str(class_name(database, box))) for box in boxes]
    objects = [numbers[box["instance_token"]] for box in boxes]
    local = sensor.boxes_to_local(np.array(rows).reshape(-1, 7))
    for box, place in zip(boxes, local[:, :3], strict=True):
        _check_near(database, box, place)
    return Annotations(np.array(objects, dtype=np.int64), np.array(classes, dtype=np.int64), local)


def body_of(
    database: Database, box: JsonRow, numbers: dict[str, int], sensor: Frame
) -> AnnotatedBody:
    """A box of any category as a body, seen from the LiDAR."""
    frame = sensor.seeing(frame_of(database, "sample_annotation", box))
    _check_near(database, box, frame.origin)
    label = class_name(database, box)
    number = NO_OBJECT if label is None else numbers[box["instance_token"]]
    return AnnotatedBody(number, label, _size(database, box), frame)


def visible_shares(database: Database, boxes: Sequence[JsonRow]) -> Floats:
    """(n,) the share of each object that its level of visibility stands for; 1 without a level."""
    return np.array([_share(database, box["visibility_token"]) for box in boxes])


def _check_near(database: Database, box: JsonRow, place: Floats) -> None:
    away = np.abs(place).max()
    if away > AWAY_M[1]:
        raise InvalidInput(
            f"{database.path('sample_annotation')}: {box['token']!r} lies {away:g} m from the "
            f"LiDAR, may lie {AWAY_M[1]:g} m from it"
        )


def _size(database: Database, box: JsonRow) -> tuple[float, float, float]:
    """Length, width and height; the table has width, length, height."""
    width, length, height = database.numbers(
        "sample_annotation", box, "size", 3, within=SIZES_M
    ).tolist()
    return length, width, height


def _share(database: Database, token: str) -> float:
    if not token:
        return 1.0
    level = database.row("visibility", token)["level"]
    if level not in VISIBLE_SHARES:
        known = ", ".join(VISIBLE_SHARES)
        raise InvalidInput(
            f"{database.path('visibility')}: {token!r} has the unknown level {level!r}; known: "
            f"{known}"
        )
    return VISIBLE_SHARES[level]


NUSCENES_KEYFRAME_S = 0.5
"""nuScenes annotates its keyframes at 2 Hz."""


def nuscenes_film(
    database: Database,
    scene: JsonRow,
    grid: AngularGrid | None = None,
    detections: DetectionFile | None = None,
    sweeps: int = 1,
    camera_times: str = OWN,
    empty_boxes: bool = False,
) -> Film:
    """Return the film of a scene, in the cells of `grid`, by default the paper's. The cameras'
    boxes come from `detections`, else from annotations. With several `sweeps`, keyframes have that
    many: their own, and the last before it. `camera_times` and `empty_boxes` are those of
    `care_sim.sources.nuscenes.recordings.NuScenes`.

    Raises InvalidInput for a token that points nowhere, a missing recording, a truncated sweep, or
    a sweep that is missing among others. Also raises it for a detection on a picture outside
    keyframes, and for a scene without the requested sweeps between keyframes.
    """
    if detections is not None:
        detections.check(database)
    samples = database.samples(scene)
    data = [_recordings(database, sample) for sample in samples]
    files = [database.root / recordings[LIDAR]["filename"] for recordings in data]
    is_swept = any(map(os.path.exists, files))
    if not is_swept:
        absent = f"{database.root}: no recorded sweeps (samples/{LIDAR})"
        if sweeps > 1:
            raise InvalidInput(f"{absent}: sweeps must be 1, got {sweeps}")
        report_once(f"{absent}: annotated boxes become bodies, and rays are cast at them")
    grid = grid or AngularGrid()
    lidar = lidar_mount(database, data[0][LIDAR])
    cameras = tuple(camera_of(database, data[0][channel], lidar) for channel in CAMERA_CHANNELS)
    if not (is_swept or detections):
        cameras = tuple(camera.rendered for camera in cameras)
    numbers = object_numbers(database, samples)
    setup = _SceneSetup(
        database, lidar, cameras, numbers, grid, detections, camera_times, empty_boxes, is_swept
    )
    cars = [
        frame_of(database, "ego_pose", database.pose_of(recordings[LIDAR])) for recordings in data
    ]
    # Timestamps are microseconds. The motion is that of the poses at which the sweeps were taken.
    times = np.array([sample["timestamp"] - samples[0]["timestamp"] for sample in samples]) * 1e-6
    moments = zip(samples, data, times.tolist(), cars, motions(times, cars), strict=True)
    shots: tuple[Shot, ...]
    shots, every, filled = zip(*(setup.shot(*moment) for moment in moments), strict=True)
    if sweeps > 1:
        shots = with_earlier_sweeps(database, samples, shots, lidar, grid, sweeps - 1)
    report_empty_boxes(scene["name"], every, filled, grid.range_m)
    return Film(
        scene["name"],
        tuple(camera.pinhole for camera in cameras),
        lidar.z,
        NUSCENES_KEYFRAME_S,
        shots,
        every[0].take(~(filled[0] | empty_boxes)),
        grid,
        detected=detections is not None,
    )


def sweep_files(database: Database, scene: JsonRow, sweeps: int = 1) -> list[Path]:
    """Return the files of the LiDAR that the film of a scene is made of.

    Raises InvalidInput for tables that do not name them.
    """
    samples = database.samples(scene)
    rows = [_recordings(database, sample)[LIDAR] for sample in samples]
    if sweeps > 1:
        rows += [row for between in earlier(database, samples, sweeps - 1) for row in between]
    files = [database.root / row["filename"] for row in rows]
    # A damaged row may name a folder, which no film reads.
    return [file for file in files if not os.path.isdir(file)]


@dataclass(frozen=True)
class _SceneSetup:
    """Setup of a whole scene: the LiDAR's frame in the car, the cameras, a number per instance, and
    how it is filmed.
    """

    database: Database
    lidar: Frame
    cameras: tuple[RecordedCamera, ...]
    numbers: dict[str, int]
    grid: AngularGrid
    detections: DetectionFile | None
    camera_times: str
    empty_boxes: bool
    is_swept: bool

    def shot(
        self, sample: JsonRow, recordings: dict[str, JsonRow], time_s: float, car: Frame, ego: Ego
    ) -> tuple[Shot, Annotations, Mask]:
        """The keyframe of a sample, all boxes (n) of the five classes, and (n,) which of them hold
        a point.
        """
        sensor = car.holding(self.lidar.origin, self.lidar.rotation)
        boxes = self.database.annotations(sample["token"])
        labelled = [box for box in boxes if class_name(self.database, box) is not None]
        every = annotations_of(self.database, labelled, self.numbers, sensor)
        filled = np.array([box["has_points"] for box in labelled], bool)
        kept = filled | self.empty_boxes
        annotations = every.take(kept)
        taken = [recordings[channel] for channel in CAMERA_CHANNELS]
        pictures = pictures_of(self.database, sample, taken, self.lidar, sensor, self.camera_times)
        own = [moment.boxes_of(sensor, annotations.boxes) for moment in pictures.moments]
        if self.is_swept:
            points = read_points(self.database.root / recordings[LIDAR]["filename"])
            cloud = recorded_cloud(points, self.grid, annotations, sensor)
        else:
            seen, cloud = self._sensed(boxes, sensor, pictures.moments)
        if self.detections:
            seen = self.detections.seen(self.cameras, [*zip(taken, own, strict=True)], annotations)
        elif self.is_swept:
            shares = visible_shares(self.database, labelled)[kept]
            seen = projected_detections(self.cameras, own, annotations, shares)
        seen = seen.taken_at(pictures.timing)
        shot = Shot(time_s, sample["token"], sensor, ego, annotations, seen, cloud)
        return shot, every, filled

    def _sensed(
        self, boxes: Sequence[JsonRow], sensor: Frame, moments: Sequence[Frame]
    ) -> tuple[IdentifiedDetections, Cloud]:
        """Return what cameras and LiDAR see of the boxes as bodies."""
        bodies = [
            body_of(self.database, box, self.numbers, sensor)
            for box in boxes
            if box["has_points"] or self.empty_boxes
        ]
        # Boxes from a file need no pictures. All is seen from the LiDAR, since the coordinates of a
        # map lie kilometres from their origin.
        places = () if self.detections else zip(self.cameras, moments, strict=True)
        views = [camera.view(sensor.seeing(moment)) for camera, moment in places]
        up = self.lidar.vectors_to_local(np.array([0.0, 0.0, 1.0]))
        here = Frame(0.0, 0.0, 0.0, 0.0)
        _, seen, cloud = sense(bodies, here, self.lidar.z, self.grid, views=views, up=up)
        return seen, cloud


def _recordings(database: Database, sample: JsonRow) -> dict[str, JsonRow]:
    found = database.keyframe_data(sample["token"])
    for channel in (LIDAR, *CAMERA_CHANNELS):
        if channel not in found:
            raise InvalidInput(
                f"{database.path('sample_data')}: no {channel} of the sample {sample['token']!r}"
            )
    return found
