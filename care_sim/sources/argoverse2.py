"""Argoverse 2 sensor logs as films: annotated boxes and car poses become bodies, and rays are cast at them.

Wilson et al. 2021, "Argoverse 2: Next Generation Datasets for Self-Driving Perception and Forecasting"; the layout
and the taxonomy are those of its Sensor Dataset guide. A log folder needs `city_SE3_egovehicle.feather` and one
`annotations*.feather`; its sensor recordings are not used.

Boxes without a recorded LiDAR point inside are left out, as the official evaluation leaves them out: nobody saw
those objects there. Static surroundings are not annotated, so only what is annotated occludes.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from care_sim.errors import InvalidInput, unknown
from care_sim.film import Film, Shot
from care_sim.frames import Floats, Frame
from care_sim.grid import AngularGrid, Cells
from care_sim.sensors.surround import SURROUND_CAMERAS
from care_sim.sources.feather import Columns, read_columns
from care_sim.sources.motion import motions
from care_sim.sources.staging import Prop, shoot

UP_LIDAR = (1.35, 0.0, 1.64)
"""Metres in the car's frame: `up_lidar` in the calibration of the Sensor Dataset guide."""
CAR_FRAME_HEIGHT_M = 0.33
"""The origin of the car's frame, the middle of its rear axle, stands this far above the road: the wheels' radius, and
where the returns of a recorded sweep lie within 10 m."""
SENSOR_HEIGHT_M = UP_LIDAR[2] + CAR_FRAME_HEIGHT_M
KEYFRAME_S = 0.5
NANOSECONDS = 10**9
HALF_SWEEP_NS = NANOSECONDS // 20
"""Annotations come at 10 Hz: the nearest is this far from a moment at most, unless a sweep holds none."""

CATEGORIES: dict[str, str | None] = {
    "REGULAR_VEHICLE": "car",
    "BOX_TRUCK": "truck",
    "LARGE_VEHICLE": "truck",
    "TRUCK": "truck",
    "TRUCK_CAB": "truck",
    "ARTICULATED_BUS": "bus",
    "BUS": "bus",
    "SCHOOL_BUS": "bus",
    "BICYCLE": "bicycle",
    "OFFICIAL_SIGNALER": "pedestrian",
    "PEDESTRIAN": "pedestrian",
    # Outside the five classes: bodies that occlude, and that nobody reports. Riders have boxes of their own; as in
    # nuScenes the bicycle counts, once, and its rider does not.
    "ANIMAL": None,
    "BICYCLIST": None,
    "BOLLARD": None,
    "CONSTRUCTION_BARREL": None,
    "CONSTRUCTION_CONE": None,
    "DOG": None,
    "MESSAGE_BOARD_TRAILER": None,
    "MOBILE_PEDESTRIAN_CROSSING_SIGN": None,
    "MOBILE_PEDESTRIAN_SIGN": None,
    "MOTORCYCLE": None,
    "MOTORCYCLIST": None,
    "RAILED_VEHICLE": None,
    "SIGN": None,
    "STOP_SIGN": None,
    "STROLLER": None,
    "TRAFFIC_LIGHT_TRAILER": None,
    "VEHICULAR_TRAILER": None,
    "WHEELCHAIR": None,
    "WHEELED_DEVICE": None,
    "WHEELED_RIDER": None,
}
"""The class of every category of the taxonomy, None outside the five classes."""
RECORDING_CAR = "EGO_VEHICLE"
"""The category of the recording car itself, which is no object of its own film."""

POSE_FILE, ANNOTATION_FILES = "city_SE3_egovehicle.feather", "annotations*.feather"
_PLACE, _TURN, _SIZE = ("tx_m", "ty_m", "tz_m"), ("qx", "qy", "qz", "qw"), ("length_m", "width_m", "height_m")
_POSE_TYPES = {"timestamp_ns": int, **dict.fromkeys((*_PLACE, *_TURN), float)}
_BOX_TYPES = {
    **_POSE_TYPES,
    **dict.fromkeys(_SIZE, float),
    "track_uuid": str,
    "category": str,
    "num_interior_pts": int,
}


def logs(folder: Path) -> list[Path]:
    """The log folders in a folder, by name; a folder that is itself a log is the only one.

    Raises InvalidInput where there is none.
    """
    found = [path for path in (folder, *sorted(folder.glob("*"))) if _is_log(path)]
    if not found:
        raise InvalidInput(f"{folder}: no Argoverse 2 log (a folder with {POSE_FILE} and {ANNOTATION_FILES})")
    return found[:1] if found[0] == folder else found


def film(log: Path, grid: AngularGrid | None = None) -> Film:
    """The film of a log, every cell of `grid` (the paper's, unless given) fired in every keyframe.

    Raises InvalidInput for a file that is missing, truncated or incomplete, a timestamp without a pose, an unknown
    category, an object annotated twice at once.
    """
    boxes_file, pose_file = _annotation_file(log), log / POSE_FILE
    sweeps, boxes = _read_boxes(boxes_file)
    poses = _read_poses(pose_file)
    for stamp in np.setdiff1d(sweeps, poses["timestamp_ns"])[:1]:
        raise InvalidInput(f"{pose_file}: no pose for the timestamp {stamp} of {boxes_file.name}")
    keyframes = _keyframes(sweeps, poses["timestamp_ns"])
    moments = np.union1d(sweeps, keyframes)
    cars = _car_frames(poses, moments)
    times = (moments - moments[0]) / NANOSECONDS
    egos = motions(times, cars)
    grid, shots = grid or AngularGrid(), []
    for row in np.searchsorted(moments, keyframes).tolist():
        sensor = cars[row].holding(np.array(UP_LIDAR))
        seen = shoot(_props(boxes, moments[row]), sensor, SENSOR_HEIGHT_M, grid)
        shots.append(Shot(float(times[row]), str(moments[row]), sensor, egos[row], *seen))
    return Film(log.name, SURROUND_CAMERAS, SENSOR_HEIGHT_M, KEYFRAME_S, tuple(shots))


def _is_log(path: Path) -> bool:
    return (path / POSE_FILE).is_file() or any(path.glob(ANNOTATION_FILES))


def _annotation_file(log: Path) -> Path:
    found = sorted(log.glob(ANNOTATION_FILES))
    if not found:
        raise InvalidInput(f"{log / ANNOTATION_FILES}: no such file")
    return found[0]


def _read_boxes(path: Path) -> tuple[Cells, Columns]:
    """The annotated timestamps (n,), ascending, and the checked annotations, without the recording car, each with the
    `number` of its track in the film.
    """
    boxes = read_columns(path, _BOX_TYPES)
    sweeps, kept = np.unique(boxes["timestamp_ns"]), boxes["category"] != RECORDING_CAR
    boxes = {name: column[kept] for name, column in boxes.items()}
    if not kept.any():
        raise InvalidInput(f"{path}: no annotations")
    for category in np.unique(boxes["category"]).tolist():
        if category not in CATEGORIES:
            raise InvalidInput(f"{path}: {unknown('category', category, CATEGORIES)}")
    numbers = np.unique(boxes["track_uuid"], return_inverse=True)[1]
    for wrong, message in (
        ((_table(boxes, _SIZE) <= 0).any(axis=1), "has a box without length, width or height"),
        (~_table(boxes, _TURN).any(axis=1), "has a quaternion qw, qx, qy, qz of length zero"),
        (_repeated(np.column_stack([boxes["timestamp_ns"], numbers])), "is annotated twice"),
    ):
        if wrong.any():
            row = wrong.argmax()
            raise InvalidInput(f"{path}: track {boxes['track_uuid'][row]} {message} at {boxes['timestamp_ns'][row]}")
    return sweeps, boxes | {"number": numbers}


def _read_poses(path: Path) -> Columns:
    """The checked poses of the car, in order of time."""
    poses = read_columns(path, _POSE_TYPES)
    stamps = poses["timestamp_ns"]
    for wrong, message in (
        (~_table(poses, _TURN).any(axis=1), "a quaternion qw, qx, qy, qz of length zero"),
        (_repeated(stamps[:, None]), "two poses"),
    ):
        if wrong.any():
            raise InvalidInput(f"{path}: {message} at {stamps[wrong.argmax()]}")
    order = np.argsort(stamps)
    return {name: column[order] for name, column in poses.items()}


def _repeated(rows: Cells) -> NDArray[np.bool_]:
    """(n,) which rows (n, k) stand further up as well."""
    repeated = np.ones(len(rows), dtype=bool)
    repeated[np.unique(rows, axis=0, return_index=True)[1]] = False
    return repeated


def _keyframes(sweeps: Cells, posed: Cells) -> Cells:
    """Timestamps every half second from the first annotated sweep to the last: of the annotated sweep that is
    nearest, or, where the sweep holds no annotation, of the nearest pose. Both ascend.
    """
    moments = np.arange(sweeps[0], sweeps[-1] + HALF_SWEEP_NS, round(KEYFRAME_S * NANOSECONDS))
    annotated = _nearest(sweeps, moments)
    chosen = np.where(np.abs(annotated - moments) <= HALF_SWEEP_NS, annotated, _nearest(posed, moments))
    return np.unique(chosen)


def _nearest(stamps: Cells, moments: Cells) -> Cells:
    """(m,) the nearest of ascending `stamps` (n,) to every one of `moments` (m,)."""
    after = np.clip(np.searchsorted(stamps, moments), 1, max(len(stamps) - 1, 1))
    before, after = stamps[after - 1], stamps[np.minimum(after, len(stamps) - 1)]
    return np.where(moments - before <= after - moments, before, after)


def _car_frames(poses: Columns, moments: Cells) -> list[Frame]:
    """The car's frame at every moment, each of which has a pose. The world is the city's, moved to the first."""
    rows = np.searchsorted(poses["timestamp_ns"], moments)
    places, turns = _table(poses, _PLACE)[rows], Rotation.from_quat(_table(poses, _TURN)[rows])
    return [Frame.turned_by(turn, place) for turn, place in zip(turns, places - places[0], strict=True)]


def _props(boxes: Columns, sweep: int) -> list[Prop]:
    """What was seen in a sweep; the sensor's axes are the car's."""
    seen = (boxes["timestamp_ns"] == sweep) & (boxes["num_interior_pts"] > 0)
    numbers, labels = boxes["number"][seen].tolist(), [CATEGORIES[name] for name in boxes["category"][seen].tolist()]
    sizes = [tuple(size) for size in _table(boxes, _SIZE)[seen].tolist()]
    places, turns = _table(boxes, _PLACE)[seen] - UP_LIDAR, _table(boxes, _TURN)[seen]
    frames = [Frame.turned_by(Rotation.from_quat(turn), place) for turn, place in zip(turns, places, strict=True)]
    return [Prop(*values) for values in zip(numbers, labels, sizes, frames, strict=True)]


def _table(columns: Columns, names: tuple[str, ...]) -> Floats:
    return np.column_stack([columns[name] for name in names]).astype(float)
