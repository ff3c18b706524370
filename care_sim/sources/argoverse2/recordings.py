"""Argoverse 2 sensor logs as films: of recorded sweeps, or of annotated boxes that become bodies,
at which rays are cast.

Wilson et al. 2021, "Argoverse 2: Next Generation Datasets for Self-Driving Perception and
Forecasting"; the layout and the taxonomy are those of its Sensor Dataset guide. A log folder needs
`city_SE3_egovehicle.feather` and one `annotations*.feather`. Its sweeps are used if it holds one of
every keyframe (`sensors/lidar/TIMESTAMP.feather`). Pictures are those of the boxes in any case.

Boxes without a recorded LiDAR point inside are left out, as the official evaluation leaves them
out: nobody saw those objects there. Such boxes of the first keyframe are in `Film.hidden`, since
the objects were present. With `empty_boxes` they are annotated. Static surroundings are not
annotated, so only what is annotated occludes.
"""

import os
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from care_sim.base.checks import check_flag, check_known
from care_sim.base.digests import Stamp, file_stamp
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Integers, Mask
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.loops.film import Film, Shot
from care_sim.sensors.annotated import Annotations
from care_sim.sensors.surround import SURROUND_CAMERAS
from care_sim.sources.argoverse2.tables import (
    ANNOTATION_FILES,
    ARGOVERSE2_CATEGORIES,
    PLACE,
    POSE_FILE,
    SIZE,
    TURN,
    Columns,
    annotation_file,
    read_boxes,
    read_points,
    read_poses,
    table,
)
from care_sim.sources.box_films import SPAN_S, AnnotatedBody, annotations_of, motions, sense
from care_sim.sources.film_checks import report_empty_boxes, report_once
from care_sim.sources.nuscenes.sweeps import recorded_cloud
from care_sim.sources.recordings import Recordings

UP_LIDAR = (1.35, 0.0, 1.64)
"""Metres in the car's frame: `up_lidar` in the calibration of the Sensor Dataset guide."""
CAR_FRAME_HEIGHT_M = 0.33
"""Height of the car's origin, the middle of its rear axle, above the road. It is the wheels'
radius, and fits the returns of a recorded sweep within 10 m.
"""
ARGOVERSE2_SENSOR_HEIGHT_M = UP_LIDAR[2] + CAR_FRAME_HEIGHT_M
ARGOVERSE2_KEYFRAME_S = 0.5
NANOSECONDS = 10**9
LABELLED_SPLITS = ("train", "val")
"""Folders of the official download whose logs are annotated; those of `test` are not."""
HALF_SWEEP_NS = NANOSECONDS // 20
"""Annotations come at 10 Hz. Largest distance of the nearest annotation from a moment, unless a
sweep holds none.
"""


def logs(folder: Path, split: str | None = None) -> list[Path]:
    """The log folders in a folder, by name; a folder that is itself a log is the only one. Without
    any, those in its folders `train` and `val`; of a `split`, those in the folder of that name.

    Raises InvalidInput where there is none.
    """
    # Absolute, since a log is called by its folder: `.` has no name.
    folder = Path(os.path.abspath(folder))
    if split is not None:
        check_known(f"split in {folder}", split, {path.name for path in folder.glob("*/")})
        folder = folder / split
    below = [log for name in LABELLED_SPLITS for log in sorted((folder / name).glob("*"))]
    for places in ([folder], sorted(folder.glob("*")), below):
        if found := [path for path in places if _is_log(path)]:
            return found
    raise InvalidInput(
        f"{folder}: no Argoverse 2 log (a folder with {POSE_FILE} and {ANNOTATION_FILES})"
    )


def argoverse2_film(log: Path, grid: AngularGrid | None = None, empty_boxes: bool = False) -> Film:
    """The film of a log, every cell of `grid` (the paper's, unless given) fired in every keyframe.
    With `empty_boxes` also boxes without a recorded point are annotated, and bodies.

    Raises InvalidInput for a file that is missing, truncated or incomplete, a timestamp without a
    pose, an unknown category, an object annotated twice at once.
    """
    log = Path(os.path.abspath(log))
    sweeps, boxes, poses = _tables(log)
    keyframes = _keyframes(sweeps, poses["timestamp_ns"])
    recorded = _recorded_sweeps(log, keyframes)
    if recorded and len(recorded) < len(keyframes):
        report_once(
            f"{log.name}: {len(recorded)} of {len(keyframes)} keyframes have a sweep, so rays are "
            "cast at the boxes of all"
        )
    # The car's motion is fitted to all annotated moments, the film is made of the keyframes. An
    # earlier pose gives the first keyframe a past.
    before = poses["timestamp_ns"][poses["timestamp_ns"] < sweeps[0]]
    before = before[before >= sweeps[0] - round(SPAN_S * NANOSECONDS)][:1]
    moments = np.union1d(np.concatenate([before, sweeps]), keyframes)
    cars = _car_frames(poses, moments, origin=keyframes[0])
    times = (moments - keyframes[0]) / NANOSECONDS
    egos = motions(times, cars)
    grid = grid or AngularGrid()
    shots: list[Shot] = []
    every: list[Annotations] = []
    filled: list[Mask] = []
    for row in np.searchsorted(moments, keyframes).tolist():
        sensor = cars[row].holding(np.array(UP_LIDAR))
        bodies, holds = _bodies(boxes, moments[row])
        kept = [body for body, held in zip(bodies, holds, strict=True) if held or empty_boxes]
        annotations, pictures, cloud = sense(kept, sensor, ARGOVERSE2_SENSOR_HEIGHT_M, grid)
        if len(recorded) == len(keyframes):
            points = read_points(recorded[len(shots)])
            points[:, :3] -= UP_LIDAR
            cloud = recorded_cloud(points, grid, annotations, sensor)
        seen = (annotations, pictures, cloud)
        shots.append(Shot(float(times[row]), str(moments[row]), sensor, egos[row], *seen))
        reported = np.array([body.label is not None for body in bodies], bool)
        every.append(annotations_of([body for body in bodies if body.label is not None]))
        filled.append(holds[reported])
    report_empty_boxes(log.name, every, filled, grid.range_m)
    hidden = every[0].take(~(filled[0] | empty_boxes))
    return Film(
        log.name,
        SURROUND_CAMERAS,
        ARGOVERSE2_SENSOR_HEIGHT_M,
        ARGOVERSE2_KEYFRAME_S,
        tuple(shots),
        hidden,
        grid,
    )


def annotations_at(log: Path, sweep: int) -> Annotations:
    """Return the annotations of a log at the timestamp of a sweep that hold a recorded point, in
    the frame of the LiDAR. Raises InvalidInput for tables that cannot be read.
    """
    _, boxes, _ = _tables(log)
    bodies, holds = _bodies(boxes, sweep)
    kept = zip(bodies, holds, strict=True)
    return annotations_of([body for body, held in kept if held and body.label is not None])


def sweep_files(log: Path) -> list[Path]:
    """Return the recorded sweeps that the film of a log is made of; none unless every keyframe has
    one. Raises InvalidInput for tables that cannot be read.
    """
    sweeps, _, poses = _tables(log)
    keyframes = _keyframes(sweeps, poses["timestamp_ns"])
    found = _recorded_sweeps(log, keyframes)
    return found if len(found) == len(keyframes) else []


def _tables(log: Path) -> tuple[Integers, Columns, Columns]:
    """Return the annotated timestamps, the boxes and the poses. Raises InvalidInput for a timestamp
    without a pose.
    """
    boxes_file, pose_file = annotation_file(log), log / POSE_FILE
    sweeps, boxes = read_boxes(boxes_file)
    poses = read_poses(pose_file)
    without_pose = np.setdiff1d(sweeps, poses["timestamp_ns"])
    if len(without_pose):
        raise InvalidInput(
            f"{pose_file}: no pose for the timestamp {without_pose[0]} of {boxes_file.name}"
        )
    return sweeps, boxes, poses


def _recorded_sweeps(log: Path, keyframes: Integers) -> list[Path]:
    """Return the sweeps of the keyframes, as far as they are there."""
    files = [log / "sensors" / "lidar" / f"{stamp}.feather" for stamp in keyframes.tolist()]
    return [file for file in files if file.is_file()]


def _is_log(path: Path) -> bool:
    return (path / POSE_FILE).is_file() or any(path.glob(ANNOTATION_FILES))


def _keyframes(sweeps: Integers, posed: Integers) -> Integers:
    """Timestamps every half second from the first annotated sweep to the last: of the annotated
    sweep that is nearest, or, where the sweep holds no annotation, of the nearest pose. Both
    ascend.
    """
    moments = np.arange(
        sweeps[0], sweeps[-1] + HALF_SWEEP_NS, round(ARGOVERSE2_KEYFRAME_S * NANOSECONDS)
    )
    annotated = _nearest(sweeps, moments)
    chosen = np.where(
        np.abs(annotated - moments) <= HALF_SWEEP_NS, annotated, _nearest(posed, moments)
    )
    return np.unique(chosen)


def _nearest(stamps: Integers, moments: Integers) -> Integers:
    """(m,) the nearest of ascending `stamps` (n,) to every one of `moments` (m,)."""
    # The first stamp that is not earlier, and the one before it; a single stamp is both. The
    # earlier of two equally near stamps counts.
    row = np.clip(np.searchsorted(stamps, moments), 1, max(len(stamps) - 1, 1))
    before = stamps[row - 1]
    after = stamps[np.minimum(row, len(stamps) - 1)]
    return np.where(moments - before <= after - moments, before, after)


def _car_frames(poses: Columns, moments: Integers, origin: int) -> list[Frame]:
    """Return the car's frame at every moment. Each moment has a pose. The world is the city's,
    moved to the car's place at the moment `origin`.
    """
    # City coordinates lie kilometres from their origin, so a film's begin at its first place.
    rows = np.searchsorted(poses["timestamp_ns"], moments)
    places = table(poses, PLACE)
    start = places[np.searchsorted(poses["timestamp_ns"], origin)]
    turns = Rotation.from_quat(table(poses, TURN)[rows])
    return [
        Frame.turned_by(turn, place)
        for turn, place in zip(turns, places[rows] - start, strict=True)
    ]


def _bodies(boxes: Columns, sweep: int) -> tuple[list[AnnotatedBody], Mask]:
    """The boxes of a sweep as bodies, and (n,) in which of them a point was recorded. The sensor's
    axes are the car's.
    """
    own = boxes["timestamp_ns"] == sweep
    boxes = {name: column[own] for name, column in boxes.items()}
    numbers = boxes["number"].tolist()
    labels = [ARGOVERSE2_CATEGORIES[name] for name in boxes["category"].tolist()]
    sizes = [tuple(size) for size in table(boxes, SIZE).tolist()]
    # The LiDAR is mounted without a turn, so its frame differs by its place alone.
    places = table(boxes, PLACE) - UP_LIDAR
    turns = table(boxes, TURN)
    frames = [
        Frame.turned_by(Rotation.from_quat(turn), place)
        for turn, place in zip(turns, places, strict=True)
    ]
    bodies = [AnnotatedBody(*one) for one in zip(numbers, labels, sizes, frames, strict=True)]
    return bodies, boxes["num_interior_pts"] > 0


@dataclass(frozen=True)
class Argoverse2(Recordings):
    """Argoverse 2 sensor logs; a scene is a log. The source reads the folder `split` of a download,
    or `train` and `val` without it. With `empty_boxes` also boxes without a recorded point are
    annotated.
    """

    kind = "argoverse2"
    licence = "CC BY-NC-SA 4.0, not for commercial use"
    split: str | None = None
    empty_boxes: bool = False

    def __post_init__(self) -> None:
        check_flag("empty_boxes", self.empty_boxes)

    def scenes(self) -> list[str]:
        """The names of the log folders."""
        return list(self._logs())

    def film(self, scene: str) -> Film:
        """See `care_sim.sources.argoverse2.recordings.argoverse2_film`."""
        known = self._logs()
        check_known(f"log in {self.folder}", scene, known)
        return argoverse2_film(known[scene], empty_boxes=self.empty_boxes)

    def files(self, scene: str) -> list[Path]:
        """Poses, annotations, and the sweeps where all that the film needs are there."""
        log = self._logs().get(scene, self.folder / scene)
        try:
            tables = (log / POSE_FILE, annotation_file(log))
            return [*tables, *_sweep_files(log, tuple(map(file_stamp, tables)))]
        except InvalidInput:  # `film` refuses the scene
            return [log / POSE_FILE]

    def columns(self) -> dict[str, Any]:
        """Whether boxes without a point are annotated, where they are."""
        return {"empty_boxes": True} if self.empty_boxes else {}

    def _logs(self) -> dict[str, Path]:
        return {log.name: log for log in logs(self.folder, self.split)}


# Tables are read once for all plays of a log, until one of them changes. Sweeps that are added
# later are found in a new process.
@lru_cache(maxsize=1000)
def _sweep_files(log: Path, _stamps: tuple[Stamp, ...]) -> tuple[Path, ...]:
    return tuple(sweep_files(log))
