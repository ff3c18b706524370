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
from collections.abc import Sequence
from dataclasses import dataclass
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
from care_sim.sources.nuscenes.mounts import camera_of, frame_of, lidar_mount
from care_sim.sources.nuscenes.pictures import OWN, pictures_of
from care_sim.sources.nuscenes.sweeps import (
    earlier,
    read_points,
    recorded_cloud,
    with_earlier_sweeps,
)
from care_sim.sources.nuscenes.table_files import JsonRow
from care_sim.sources.nuscenes.tables import CAMERA_CHANNELS, LIDAR, Database

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
    tell_empty_boxes(scene["name"], every, filled, grid.range_m)
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
