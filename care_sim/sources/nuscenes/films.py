"""nuScenes scenes as films: recorded sweeps, annotations of the 2 Hz keyframes, six recorded
cameras.

A scene without any recorded sweep is played on its boxes, as Argoverse 2 logs are: boxes become
bodies, those outside the five classes too, rays are cast at them, and the recorded cameras render
them. Static surroundings are not annotated, so only boxes occlude.

Boxes without a LiDAR or radar point inside are left out, as the official evaluation leaves them
out; those of the first keyframe are in `Film.hidden`, since the objects were present. They are no
bodies either: nobody measured where they are, and a ray would hit what the LiDAR did not reach.
With `empty_boxes` they are annotated, and bodies.

The car's motion is that of the keyframes' poses. Pictures are taken within 50 ms of the sweep
(`care_sim.sources.nuscenes.pictures`).
"""

import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Mask
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.core.types import Ego
from care_sim.loops.film import Film, Shot
from care_sim.sensors.annotated import Annotations, Cloud, IdentifiedDetections
from care_sim.sources.boxes_as_bodies import sense
from care_sim.sources.car_motion import motions
from care_sim.sources.empty_boxes import tell_empty_boxes
from care_sim.sources.film_checks import report_once
from care_sim.sources.nuscenes.boxes import (
    annotations_of,
    body_of,
    class_name,
    object_numbers,
    visible_shares,
)
from care_sim.sources.nuscenes.cameras import RecordedCamera, projected_detections
from care_sim.sources.nuscenes.detections import DetectionFile
from care_sim.sources.nuscenes.earlier_sweeps import earlier, with_earlier_sweeps
from care_sim.sources.nuscenes.mounts import camera_of, frame_of, lidar_mount
from care_sim.sources.nuscenes.pictures import OWN, Pictures, pictures_of
from care_sim.sources.nuscenes.sweeps import read_points, recorded_cloud
from care_sim.sources.nuscenes.table_files import JsonRow
from care_sim.sources.nuscenes.tables import CAMERA_CHANNELS, LIDAR, Database

NUSCENES_KEYFRAME_S = 0.5
"""nuScenes annotates its keyframes at 2 Hz."""
_UP = np.array([0.0, 0.0, 1.0])


def nuscenes_film(
    database: Database,
    scene: JsonRow,
    grid: AngularGrid | None = None,
    detections: DetectionFile | None = None,
    sweeps: int = 1,
    camera_times: str = OWN,
    empty_boxes: bool = False,
) -> Film:
    """The film of a scene, in the cells of `grid` (the paper's, unless given). The cameras' boxes
    come from `detections`, else from annotations. With more `sweeps` than one, keyframes have that
    many: their own, and the last before it. `camera_times` and `empty_boxes` are those of
    `care_sim.sources.nuscenes.recordings.NuScenes`.

    Raises InvalidInput for a token that points nowhere, a missing recording, a truncated sweep, a
    sweep that is missing where others are there, a detection on what is no picture of a keyframe,
    and for a scene without sweeps between its keyframes where some are asked for.
    """
    if detections is not None:
        detections.check(database)
    samples = database.samples(scene)
    data = [_recordings(database, sample) for sample in samples]
    is_swept = has_sweeps(database, scene)
    if not is_swept:
        _tell_no_sweeps(database, sweeps)
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
    shots, every = zip(*(setup.shot(*moment) for moment in moments), strict=True)
    if sweeps > 1:
        shots = with_earlier_sweeps(database, samples, shots, lidar, grid, sweeps - 1)
    filled = [setup.hold_points(sample) for sample in samples]
    tell_empty_boxes(scene["name"], every, filled, grid.range_m, empty_boxes)
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


def has_sweeps(database: Database, scene: JsonRow) -> bool:
    """Whether a sweep of any keyframe of a scene is recorded. Raises InvalidInput for tables that
    do not name them.
    """
    rows = [_recordings(database, sample)[LIDAR] for sample in database.samples(scene)]
    return any(os.path.exists(database.root / row["filename"]) for row in rows)


def _tell_no_sweeps(database: Database, sweeps: int) -> None:
    if sweeps > 1:
        raise InvalidInput(
            f"{database.root}: sweeps must be 1 without recorded sweeps (samples/{LIDAR}), got "
            f"{sweeps}"
        )
    report_once(
        f"{database.root}: no recorded sweeps (samples/{LIDAR}): annotated boxes become bodies, "
        "and rays are cast at them"
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
    """What holds for a whole scene: the LiDAR's frame in the car, the cameras, a number per
    instance, and how it is filmed.
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
    ) -> tuple[Shot, Annotations]:
        """The keyframe of a sample, and all boxes of the five classes, those without points too."""
        sensor = car.holding(self.lidar.origin, self.lidar.rotation)
        every = annotations_of(self.database, self._labelled(sample), self.numbers, sensor)
        kept = self.hold_points(sample) | self.empty_boxes
        annotations = every.take(kept)
        taken = [recordings[channel] for channel in CAMERA_CHANNELS]
        pictures = pictures_of(self.database, sample, taken, self.lidar, sensor, self.camera_times)
        if self.is_swept:
            points = read_points(self.database.root / recordings[LIDAR]["filename"])
            cloud = recorded_cloud(points, self.grid, annotations, sensor)
        else:
            rendered, cloud = self._rendered(sample, sensor, pictures)
        own = [moment.boxes_of(sensor, annotations.boxes) for moment in pictures.moments]
        if self.detections:
            seen = self.detections.seen(self.cameras, [*zip(taken, own, strict=True)], annotations)
        elif self.is_swept:
            shares = visible_shares(self.database, self._labelled(sample))[kept]
            seen = projected_detections(self.cameras, own, annotations, shares)
        else:
            seen = rendered
        seen = seen.taken_at(pictures.timing)
        return Shot(time_s, sample["token"], sensor, ego, annotations, seen, cloud), every

    def hold_points(self, sample: JsonRow) -> Mask:
        """(n,) which boxes of the five classes hold a point."""
        return np.array([box["has_points"] for box in self._labelled(sample)], bool)

    def _labelled(self, sample: JsonRow) -> list[JsonRow]:
        """The boxes of the five classes."""
        boxes = self.database.annotations(sample["token"])
        return [box for box in boxes if class_name(self.database, box) is not None]

    def _rendered(
        self, sample: JsonRow, sensor: Frame, pictures: Pictures
    ) -> tuple[IdentifiedDetections, Cloud]:
        """What cameras and LiDAR see of the boxes as bodies."""
        boxes = self.database.annotations(sample["token"])
        bodies = [
            body_of(self.database, box, self.numbers, sensor)
            for box in boxes
            if box["has_points"] or self.empty_boxes
        ]
        # Map coordinates lie kilometres from their origin, too far for a picture's float32.
        here = replace(sensor, x=0.0, y=0.0, z=0.0)
        moments = [
            replace(moment, x=moment.x - sensor.x, y=moment.y - sensor.y, z=moment.z - sensor.z)
            for moment in pictures.moments
        ]
        views = [camera.view(moment) for camera, moment in zip(self.cameras, moments, strict=True)]
        # Boxes from a file need no pictures.
        views = [] if self.detections else views
        up = self.lidar.vectors_to_local(_UP)
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
