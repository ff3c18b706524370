"""Drives of the KITTI tracking benchmark, made into films of their labelled boxes.

Labels cover the picture of the front camera alone. So the films have that one camera, and an
object outside its picture is not annotated. An object that enters the picture from the side is a
newcomer where it is first labelled. An object that leaves the picture and comes back with its
number is not a newcomer again. The first keyframe is the first frame of the drive, so no label
precedes it; a label between two keyframes counts from the next keyframe on.

Poses come from a file `FOLDER/*poses/NNNN.txt`, for example `FOLDER/poses/0000.txt`: one line per
frame, 3 x 4 numbers row by row, from the camera to the first camera (metres). Where there is no
such file, they come from `FOLDER/training/oxts/NNNN.txt` and `FOLDER/training/calib/NNNN.txt`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from care_sim.base.checks import check_known
from care_sim.base.errors import InvalidInput, shown, unknown
from care_sim.base.files import check_file_size
from care_sim.core.arrays import Floats
from care_sim.core.frames import FULL_TURN, Frame
from care_sim.core.sensor_setup import SensorSetup, between, on_car
from care_sim.loops.film import Film
from care_sim.sensors.setups import sensor_setup
from care_sim.sources.box_films import film_of_boxes
from care_sim.sources.film_checks import MAP_M, report_once
from care_sim.sources.recordings import Recordings

KITTI_CATEGORIES: dict[str, str | None] = {
    "Car": "car",
    "Van": "car",
    "Truck": "truck",
    "Pedestrian": "pedestrian",
    "Cyclist": "bicycle",
    # Outside the five classes: bodies that hide others. A tram runs on rails, and is no bus, as in
    # Argoverse 2 (RAILED_VEHICLE). Labels call sitting people Person, the devkit Person_sitting.
    "Tram": None,
    "Person": None,
    "Person_sitting": None,
    "Misc": None,
}
"""The class of every type of label, None outside the five classes."""
NO_OBJECT_TYPE = "DontCare"
"""Regions of a picture that nobody labelled."""
KITTI_SETUP = "kitti"
FRAME_S = 0.1
FRAMES_PER_KEYFRAME = 5
"""Keyframes are 0.5 s apart, as in the paper."""
_AXES = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""From the axes of a camera (x right, y down, z ahead) to x ahead, y left, z up."""
_LABEL_WORDS = 17
_OXTS_NUMBERS = 30
_EARTH_RADIUS_M = 6_378_137.0
_MOST_BYTES = 2**24
"""Ten times the longest file of the benchmark."""
_LONGEST_STEP_M = 10.0
"""A car stays below 100 m/s."""
_ROUNDED = 0.01
"""Numbers of a rotation matrix may be off by this much."""


@dataclass(frozen=True)
class Kitti(Recordings):
    """The training drives of KITTI's tracking benchmark that have labels and poses, seen by the
    set-up `sensor`. A set-up without cameras gets KITTI's front camera.
    """

    kind = "kitti"
    licence = "CC BY-NC-SA 3.0, not for commercial use"
    sensor: str | SensorSetup = KITTI_SETUP

    def __post_init__(self) -> None:
        sensor_setup(self.sensor)

    def scenes(self) -> list[str]:
        """The numbers of the drives. Drives without poses are reported and left out."""
        drives = sorted(path.stem for path in self._labels.glob("*.txt"))
        if not drives:
            raise InvalidInput(f"{self._labels / 'NNNN.txt'}: no such file, so no KITTI tracking")
        unposed = [drive for drive in drives if not self._pose_files(drive)[0].exists()]
        if unposed == drives:
            raise InvalidInput(f"{self._pose_files(drives[0])[0]}: no such file, nor one of poses")
        if unposed:
            report_once(f"{self.folder}: drives without poses are left out: {', '.join(unposed)}")
        return [drive for drive in drives if drive not in unposed]

    def film(self, scene: str) -> Film:
        """The film of a drive, a keyframe every `FRAMES_PER_KEYFRAME` frames.

        Raises InvalidInput, with file and line, for what is missing or damaged.
        """
        check_known(f"drive in {self.folder}", scene, self.scenes())
        pose_file, *calibration = self._pose_files(scene)
        poses = _oxts_poses(pose_file, *calibration) if calibration else _camera_poses(pose_file)
        _check_steps(pose_file, poses)
        boxes = _boxes(self._labels / f"{scene}.txt", poses)
        own = sensor_setup(KITTI_SETUP)
        camera = np.array(on_car(own.position, own.cameras[0]))
        keyframes = range(0, len(poses), FRAMES_PER_KEYFRAME)
        return film_of_boxes(
            scene,
            [FRAME_S * frame for frame in keyframes],
            [_car(poses[frame], camera) for frame in keyframes],
            [boxes[frame] for frame in keyframes],
            self.setup,
        )

    def files(self, scene: str) -> list[Path]:
        """Labels, poses, and the calibration where the poses need it."""
        return [self._labels / f"{scene}.txt", *self._pose_files(scene)]

    @property
    def setup(self) -> SensorSetup:
        """The sensor, with KITTI's front camera where it has none."""
        chosen, own = sensor_setup(self.sensor), sensor_setup(KITTI_SETUP)
        (camera,) = own.cameras
        place = between(chosen.position, on_car(own.position, camera))
        return replace(chosen, cameras=chosen.cameras or (replace(camera, position=place),))

    @property
    def _labels(self) -> Path:
        return self.folder / "training" / "label_02"

    def _pose_files(self, drive: str) -> list[Path]:
        """Return the file of camera poses, or else those of oxts and calibration."""
        found = sorted(self.folder.glob(f"*poses/{drive}.txt"))
        if len(found) > 1:
            raise InvalidInput(
                f"{self.folder}: {', '.join(path.parent.name for path in found)}: keep one folder "
                "of poses"
            )
        training = self.folder / "training"
        return found or [training / part / f"{drive}.txt" for part in ("oxts", "calib")]


class _Pose(NamedTuple):
    """The camera in a world with z up: (3, 3) from its axes to the world's, and (3,) its place."""

    turn: Floats
    place: Floats


def _car(pose: _Pose, camera: Floats) -> list[float]:
    """Return x, y, z, yaw, roll and pitch of the car whose camera is at `camera` (3,)."""
    turn = pose.turn @ _AXES.T
    frame = Frame.turned_by(Rotation.from_matrix(turn), pose.place - turn @ camera)
    return [frame.x, frame.y, frame.z, frame.yaw, frame.roll, frame.pitch]


def _check_steps(path: Path, poses: Sequence[_Pose]) -> None:
    """Raise InvalidInput where the car jumps, as in other units or after a lost line."""
    for line, (before, pose) in enumerate(pairwise(poses), 2):
        step = np.linalg.norm(pose.place - before.place)
        if step > _LONGEST_STEP_M:
            raise InvalidInput(
                f"{path}, line {line}: the car jumps by {step:g} m; may move {_LONGEST_STEP_M:g} m "
                f"in {FRAME_S:g} s"
            )


def _boxes(path: Path, poses: Sequence[_Pose]) -> list[list[dict[str, Any]]]:
    """Return the labelled boxes of every frame, in the world, as `film_of_boxes` takes them."""
    frames: list[dict[int, dict[str, Any]]] = [{} for _ in poses]
    for line, words in _lines(path):
        if len(words) != _LABEL_WORDS:
            raise InvalidInput(f"{line}: must have {_LABEL_WORDS} columns, got {len(words)}")
        label = words.pop(2)
        numbers = _numbers(line, words, _LABEL_WORDS - 1)
        frame, track = numbers[:2].astype(int).tolist()
        if frame != numbers[0] or not 0 <= frame < len(poses):
            raise InvalidInput(f"{line}: frame {words[0]} has no pose; there are {len(poses)}")
        if label == NO_OBJECT_TYPE:
            continue
        if label not in KITTI_CATEGORIES:
            raise InvalidInput(f"{line}: {unknown('type', label, KITTI_CATEGORIES)}")
        if track in frames[frame]:
            raise InvalidInput(f"{line}: object {track} is labelled twice in frame {frame}")
        height, width, length, x, y, z, turn = numbers[9:].tolist()
        if abs(turn) > FULL_TURN:
            raise InvalidInput(f"{line}: rotation must be radians within a turn, got {turn:g}")
        pose = poses[frame]
        # The place is that of the bottom, and y points down. An object that is not turned has its
        # length along the camera's x axis.
        centre = pose.turn @ [x, y - height / 2, z] + pose.place
        ahead = pose.turn @ [np.cos(turn), 0.0, -np.sin(turn)]
        frames[frame][track] = {
            "id": track,
            "class": KITTI_CATEGORIES[label],
            "size": (length, width, height),
            "pose": [*centre, np.arctan2(ahead[1], ahead[0])],
        }
    return [list(frame.values()) for frame in frames]


def _camera_poses(path: Path) -> list[_Pose]:
    """Return the poses of a file of 3 x 4 numbers per frame."""
    poses = []
    for line, words in _lines(path):
        turn, place = _rigid(line, _numbers(line, words, 12))
        poses.append(_Pose(_AXES @ turn, _AXES @ place))
    return poses


def _oxts_poses(path: Path, calibration: Path) -> list[_Pose]:
    """Return the poses of the camera on a car whose inertial unit wrote a line per frame. A line
    has latitude and longitude (degrees), altitude (metres), roll, pitch and yaw (radians; yaw 0 is
    east), and more.

    Mercator's projection at the latitude of the first frame, as in `convertOxtsToPose.m` of KITTI's
    development kit for raw data. It is x = s r lon, y = s r ln tan(pi / 4 + lat / 2), s =
    cos(lat_0).
    """
    imu_turn, imu_place = _camera_from_imu(calibration)
    poses = []
    scale = None
    for line, words in _lines(path):
        lat, lon, altitude, *turns = _numbers(line, words, _OXTS_NUMBERS)[:6].tolist()
        if not (abs(lat) < 90 and abs(lon) <= 360 and max(map(abs, turns)) <= FULL_TURN):
            raise InvalidInput(
                f"{line}: must begin with latitude and longitude in degrees, altitude in metres, "
                f"roll, pitch and yaw in radians, got {shown(' '.join(words[:6]))}"
            )
        lat, lon = np.radians([lat, lon])
        scale = np.cos(lat) if scale is None else scale
        north = np.log(np.tan(np.pi / 4 + lat / 2))
        place = [*(scale * _EARTH_RADIUS_M * np.array([lon, north])), altitude]
        turn = Rotation.from_euler("xyz", turns).as_matrix() @ imu_turn.T
        poses.append(_Pose(turn, place - turn @ imu_place))
    return poses


def _camera_from_imu(path: Path) -> tuple[Floats, Floats]:
    """Return (3, 3) and (3,), the turn and the shift from the inertial unit to the camera."""
    rows = {words[0].rstrip(":"): (line, words[1:]) for line, words in _lines(path) if words}
    turn, place = np.eye(3), np.zeros(3)
    # The benchmarks of tracking and of objects call them differently.
    for names in (
        ("Tr_imu_velo", "Tr_imu_to_velo"),
        ("Tr_velo_cam", "Tr_velo_to_cam"),
        ("R_rect", "R0_rect"),
    ):
        line, words = next((rows[name] for name in names if name in rows), (None, []))
        if line is None:
            raise InvalidInput(f"{path}: {' or '.join(names)} is missing")
        is_turn = "R_rect" in names
        numbers = _numbers(line, words, 9 if is_turn else 12)
        if is_turn:
            numbers = np.insert(numbers, [3, 6, 9], 0.0)
        own_turn, own_place = _rigid(line, numbers)
        turn, place = own_turn @ turn, own_turn @ place + own_place
    return turn, place


def _rigid(line: str, numbers: Floats) -> tuple[Floats, Floats]:
    """Return rotation (3, 3) and translation (3,) of 3 x 4 numbers, row by row."""
    turn, place = numbers.reshape(3, 4)[:, :3], numbers.reshape(3, 4)[:, 3]
    off = np.abs(np.clip(turn, -2, 2) @ np.clip(turn, -2, 2).T - np.eye(3)).max()
    if off > _ROUNDED or np.linalg.det(turn) < 0:
        raise InvalidInput(f"{line}: is no pose; its first three columns must be a rotation")
    return turn, place


def _numbers(line: str, words: Sequence[str], count: int) -> Floats:
    """Return numbers (count,), none beyond `MAP_M`."""
    try:
        numbers = np.array(words, dtype=float)
    except ValueError:
        numbers = np.array([np.nan])
    least, most = MAP_M
    if len(words) != count or not ((numbers >= least) & (numbers <= most)).all():
        raise InvalidInput(f"{line}: must have {count} numbers, got {shown(' '.join(words))}")
    return numbers


def _lines(path: Path) -> Iterator[tuple[str, list[str]]]:
    """Return file and number of every line, for messages, and its words."""
    try:
        check_file_size(path, _MOST_BYTES)
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InvalidInput(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        raise InvalidInput(f"{path}: no text ({error})") from error
    for number, line in enumerate(text.rstrip().split("\n"), 1):
        yield f"{path}, line {number}", line.split()
