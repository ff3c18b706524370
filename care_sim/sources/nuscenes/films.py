"""nuScenes scenes as films: recorded sweeps, annotations of the 2 Hz keyframes, six recorded
cameras.

Boxes without a LiDAR or radar point inside are left out, as the official evaluation leaves them
out; those of the first keyframe are in `Film.hidden`, since the objects were present. The car's
motion is that of the keyframes' poses. The cameras' pictures are taken within 50 ms of the sweep;
the way that the car drives meanwhile is neglected.
"""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.core.types import CLASSES, Ego
from care_sim.loops.film import Film, Shot
from care_sim.sensors.annotated import Annotations, IdentifiedDetections
from care_sim.sources.car_motion import motions
from care_sim.sources.nuscenes.cameras import (
    CAMERA_CHANNELS,
    VISIBLE_SHARES,
    RecordedCamera,
    projected_detections,
)
from care_sim.sources.nuscenes.categories import UnknownCategory, class_of
from care_sim.sources.nuscenes.detections import DetectionFile
from care_sim.sources.nuscenes.earlier_sweeps import earlier, with_earlier_sweeps
from care_sim.sources.nuscenes.mounts import camera_of, frame_of, lidar_mount
from care_sim.sources.nuscenes.sweeps import read_points, recorded_cloud
from care_sim.sources.nuscenes.table_files import JsonRow
from care_sim.sources.nuscenes.tables import LIDAR, Database
from care_sim.sources.plausible import AWAY_M, SIZES_M

NUSCENES_KEYFRAME_S = 0.5
"""nuScenes annotates its keyframes at 2 Hz."""


def nuscenes_film(
    database: Database,
    scene: JsonRow,
    grid: AngularGrid | None = None,
    detections: DetectionFile | None = None,
    sweeps: int = 1,
) -> Film:
    """The film of a scene, in the cells of `grid` (the paper's, unless given). The cameras' boxes
    come from `detections`, else from projected annotations. With more `sweeps` than one, keyframes
    have that many: their own, and the last before it.

    Raises InvalidInput for a token that points nowhere, a missing recording, a missing or truncated
    sweep, a detection on what is no picture of a keyframe, and for a scene without sweeps between
    its keyframes where some are asked for.
    """
    if detections is not None:
        detections.check(database)
    samples = database.samples(scene)
    data = [_recordings(database, sample) for sample in samples]
    grid = grid or AngularGrid()
    setup = _scene_setup(database, samples, data[0], grid, detections)
    cars = [
        frame_of(database, "ego_pose", database.pose_of(recordings[LIDAR])) for recordings in data
    ]
    # Timestamps are microseconds. The motion is that of the poses at which the sweeps were taken.
    times = np.array([sample["timestamp"] - samples[0]["timestamp"] for sample in samples]) * 1e-6
    egos = motions(times, cars)
    shots = tuple(
        setup.shot(*moment)
        for moment in zip(samples, data, times.tolist(), cars, egos, strict=True)
    )
    if sweeps > 1:
        shots = with_earlier_sweeps(database, samples, shots, setup.lidar, grid, sweeps - 1)
    cameras = tuple(camera.pinhole for camera in setup.cameras)
    hidden = setup.hidden(samples[0], cars[0])
    return Film(
        scene["name"],
        cameras,
        setup.lidar.z,
        NUSCENES_KEYFRAME_S,
        shots,
        hidden,
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
    instance.
    """

    database: Database
    lidar: Frame
    cameras: tuple[RecordedCamera, ...]
    numbers: dict[str, int]
    grid: AngularGrid
    detections: DetectionFile | None

    def shot(
        self, sample: JsonRow, recordings: dict[str, JsonRow], time_s: float, car: Frame, ego: Ego
    ) -> Shot:
        sensor = car.holding(self.lidar.origin, self.lidar.rotation)
        boxes = self._boxes(sample, seen=True)
        annotations = _annotations(self.database, boxes, self.numbers, sensor)
        points = read_points(self.database.root / recordings[LIDAR]["filename"])
        cloud = recorded_cloud(points, self.grid, annotations, sensor)
        identified = self._seen(recordings, boxes, annotations)
        return Shot(time_s, sample["token"], sensor, ego, annotations, identified, cloud)

    def hidden(self, sample: JsonRow, car: Frame) -> Annotations:
        """What is annotated without a point."""
        boxes = self._boxes(sample, seen=False)
        return _annotations(
            self.database, boxes, self.numbers, car.holding(self.lidar.origin, self.lidar.rotation)
        )

    def _boxes(self, sample: JsonRow, seen: bool) -> list[JsonRow]:
        """The annotations of the five classes that hold a point, or those that hold none."""
        boxes = self.database.annotations(sample["token"])
        return [
            box
            for box in boxes
            if box["has_points"] == seen and _class_name(self.database, box) is not None
        ]

    def _seen(
        self, recordings: dict[str, JsonRow], boxes: list[JsonRow], annotations: Annotations
    ) -> IdentifiedDetections:
        if self.detections is None:
            return projected_detections(self.cameras, annotations, _shares(self.database, boxes))
        return self.detections.seen(
            self.cameras, [recordings[channel] for channel in CAMERA_CHANNELS], annotations
        )


def _scene_setup(
    database: Database,
    samples: list[JsonRow],
    recordings: dict[str, JsonRow],
    grid: AngularGrid,
    detections: DetectionFile | None,
) -> _SceneSetup:
    lidar = lidar_mount(database, recordings[LIDAR])
    cameras = tuple(camera_of(database, recordings[channel], lidar) for channel in CAMERA_CHANNELS)
    return _SceneSetup(
        database, lidar, cameras, _object_numbers(database, samples), grid, detections
    )


def _recordings(database: Database, sample: JsonRow) -> dict[str, JsonRow]:
    found = database.keyframe_data(sample["token"])
    for channel in (LIDAR, *CAMERA_CHANNELS):
        if channel not in found:
            raise InvalidInput(
                f"{database.path('sample_data')}: no {channel} of the sample {sample['token']!r}"
            )
    return found


def _class_name(database: Database, box: JsonRow) -> str | None:
    token = database.row("instance", box["instance_token"])["category_token"]
    try:
        return class_of(database.row("category", token)["name"])
    except UnknownCategory as error:
        raise InvalidInput(f"{database.path('category')}: {token!r}: {error}") from None


def _object_numbers(database: Database, samples: list[JsonRow]) -> dict[str, int]:
    """A number for every instance of a scene."""
    tokens = {
        box["instance_token"] for sample in samples for box in database.annotations(sample["token"])
    }
    # Sorted: the order of a set differs from process to process.
    return {token: number for number, token in enumerate(sorted(tokens))}


def _annotations(
    database: Database, boxes: list[JsonRow], numbers: dict[str, int], sensor: Frame
) -> Annotations:
    rows = np.array([_world_box(database, box) for box in boxes]).reshape(-1, 7)
    classes = [CLASSES.index(str(_class_name(database, box))) for box in boxes]
    objects = [numbers[box["instance_token"]] for box in boxes]
    local = sensor.boxes_to_local(rows)
    away = np.abs(local[:, :3]).max(axis=1, initial=0)
    if (away > AWAY_M[1]).any():
        far = away.argmax()
        path = database.path("sample_annotation")
        token = boxes[far]["token"]
        raise InvalidInput(
            f"{path}: {token!r} lies {away[far]:g} m from the LiDAR, may lie {AWAY_M[1]:g} m "
            "from it"
        )
    return Annotations(np.array(objects, dtype=np.int64), np.array(classes, dtype=np.int64), local)


def _world_box(database: Database, box: JsonRow) -> tuple[float, ...]:
    """Centre, length, width, height and heading; the table has width, length, height."""
    frame = frame_of(database, "sample_annotation", box)
    width, length, height = database.numbers(
        "sample_annotation", box, "size", 3, within=SIZES_M
    ).tolist()
    return (*frame.origin.tolist(), length, width, height, frame.yaw)


def _shares(database: Database, boxes: list[JsonRow]) -> Floats:
    return np.array([_share(database, box["visibility_token"]) for box in boxes])


def _share(database: Database, token: str) -> float:
    """The share of an object that its level of visibility stands for; 1 without a level."""
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
