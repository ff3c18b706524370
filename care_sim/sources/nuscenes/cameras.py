"""Poses of cars and sensors in nuScenes, times of pictures, and projected boxes with visibility, if
no detector was run.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats
from care_sim.core.frames import Frame
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.types import ImageDetections
from care_sim.sensors.annotated import Annotations, IdentifiedDetections
from care_sim.sensors.pictures import CAMERA_HEIGHT, CAMERA_WIDTH, MIN_PIXELS, confidence_of
from care_sim.sensors.surround import View
from care_sim.sources.film_checks import MAP_M, MOUNT_M, quaternion_fault
from care_sim.sources.nuscenes.table_files import JsonRow
from care_sim.sources.nuscenes.tables import Database

PICTURE = (1600, 900)
"""Width and height of a picture in pixels."""

VISIBLE_SHARES = {"v0-40": 0.0, "v40-60": 0.5, "v60-80": 0.7, "v80-100": 0.9}
"""The share of an object that its level of visibility stands for: the middle of the bin, and none
of the lowest, which holds the objects that no picture shows. An object without a level counts as
wholly visible."""


@dataclass(frozen=True)
class RecordedCamera:
    """One camera in the sensor frame of the LiDAR: optical centre and axes `frame`, its intrinsics
    in pixels, and the `size` of its pictures.
    """

    frame: Frame
    focal: float
    centre: tuple[float, float]
    size: tuple[int, int] = PICTURE

    @cached_property
    def pinhole(self) -> PinholeCamera:
        """The same camera with its principal point in the middle of a picture that holds the
        recorded one.
        """
        # Wide enough that the recorded picture lies within, however far off the middle its
        # principal point is; even, so that the middle is a whole pixel.
        frame = self.frame
        width, height = (
            2 * math.ceil(max(middle, size - middle))
            for middle, size in zip(self.centre, self.size, strict=True)
        )
        position = (frame.x, frame.y, frame.z)
        angle = float(2 * np.arctan(width / 2 / self.focal))
        # A camera's pitch is positive upwards, a frame's about y, to the left, downwards.
        return PinholeCamera(width, height, angle, position, frame.yaw, -frame.pitch, frame.roll)

    @property
    def shift(self) -> Floats:
        """(4,) from a box in the recorded picture to one in `pinhole`'s."""
        return np.tile(np.array([self.pinhole.width, self.pinhole.height]) / 2 - self.centre, 2)

    @property
    def rendered(self) -> "RecordedCamera":
        """The same camera with pictures as small as the rendered ones of a street."""
        share = CAMERA_WIDTH / PICTURE[0]
        u, v = self.centre
        size = CAMERA_WIDTH, CAMERA_HEIGHT
        return replace(self, focal=self.focal * share, centre=(u * share, v * share), size=size)

    def view(self, sensor: Frame) -> View:
        """The picture that it takes while the LiDAR is at the frame `sensor`."""
        left, top, right, bottom = (
            np.rint(self.shift + np.array([0, 0, *self.size])).astype(int).tolist()
        )
        return View(self.pinhole, sensor, (left, top, right, bottom))


def projected_detections(
    cameras: Sequence[RecordedCamera],
    pictures: Sequence[Floats],
    annotations: Annotations,
    shares: Floats,
) -> IdentifiedDetections:
    """Boxes of the annotated objects (n) that the pictures show: `shares` (n,) of each are visible.
    `pictures` are the boxes (n, 7) per camera, in the frame of the LiDAR when it took its picture.

    An object has a box in every picture in which its projected box, cut at the edges and times the
    visible share, would fill MIN_PIXELS of a picture CAMERA_WIDTH wide. Confidence grows with those
    pixels as for rendered pictures.
    """
    rows = [np.empty((0, len(ImageDetections.COLUMNS)))]
    objects = [np.empty(0, np.int64)]
    visible = [np.empty(0)]
    for number, (camera, own) in enumerate(zip(cameras, pictures, strict=True)):
        boxes = projected(camera, own)
        area = np.prod(np.clip(boxes[:, 2:] - boxes[:, :2], 0, None), axis=1)
        pixels = area * shares * (CAMERA_WIDTH / PICTURE[0]) ** 2
        # The same rule as for rendered pictures, at their width.
        seen = pixels >= MIN_PIXELS
        columns = annotations.classes, confidence_of(pixels), boxes
        rows.append(_rows([column[seen] for column in columns], number))
        objects.append(annotations.objects[seen])
        visible.append(shares[seen])
    return IdentifiedDetections(
        ImageDetections.from_rows(np.concatenate(rows)),
        np.concatenate(objects),
        np.concatenate(visible),
    )


def projected(camera: RecordedCamera, boxes: Floats) -> Floats:
    """(n, 4) image boxes of 3D boxes (n, 7), cut at the edges of the recorded picture, empty where
    it shows none.
    """
    # A box behind the camera projects to NaN and becomes a point, which has no area.
    shift = camera.shift
    limits = np.tile(PICTURE, 2) + shift
    return np.clip(np.nan_to_num(camera.pinhole.project_boxes(boxes), nan=shift[0]), shift, limits)


def _rows(columns: list[Floats], camera: int) -> Floats:
    zeros = np.zeros(len(columns[0]))
    return np.column_stack([*columns, zeros + camera, zeros, zeros])


FOCALS = (10.0, 1e5)
"""Pixels: of a picture 1600 wide, views of 179 degrees and of one."""
_CAMERA_FROM_FORWARD = Rotation.from_matrix([[0, -1, 0], [0, 0, -1], [1, 0, 0]])
"""From axes x forward, y left, z up to those of a camera."""
_FORWARD_FROM_RIGHT = Rotation.from_euler("z", np.pi / 2)
"""In LIDAR_TOP's own frame x points right and y forward."""


def frame_of(database: Database, table: str, row: JsonRow) -> Frame:
    """The frame that a row of `ego_pose`, `calibrated_sensor` or `sample_annotation` tells."""
    # The tables write w first, SciPy writes it last.
    w, x, y, z = database.numbers(table, row, "rotation", 4).tolist()
    mounted = table == "calibrated_sensor"
    fault = quaternion_fault(np.array([[x, y, z, w]]), has_heading=not mounted)
    if fault is not None:
        raise InvalidInput(f"{database.path(table)}: rotation of {row['token']!r}: {fault[1]}")
    origin = database.numbers(table, row, "translation", 3, within=MOUNT_M if mounted else MAP_M)
    return Frame.turned_by(Rotation.from_quat([x, y, z, w]), origin)


def lidar_mount(database: Database, data: JsonRow) -> Frame:
    """The sensor frame of the recording `data` in the car's: x forward where LIDAR_TOP has y
    forward.
    """
    token = data["calibrated_sensor_token"]
    own = frame_of(database, "calibrated_sensor", database.row("calibrated_sensor", token))
    # The car's frame stands on the road.
    if own.z < 0:
        path = database.path("calibrated_sensor")
        raise InvalidInput(f"{path}: {token!r} lies below the road, at {own.z:g} m")
    return Frame.turned_by(own.rotation * _FORWARD_FROM_RIGHT, own.origin)


def camera_of(database: Database, data: JsonRow, lidar: Frame) -> RecordedCamera:
    """The camera that made the recording `data`, in the sensor frame of the LiDAR."""
    token = data["calibrated_sensor_token"]
    row = database.row("calibrated_sensor", token)
    intrinsic = database.numbers("calibrated_sensor", row, "camera_intrinsic", 3, 3)
    if not FOCALS[0] <= intrinsic[0, 0] <= FOCALS[1]:
        raise InvalidInput(
            f"{database.path('calibrated_sensor')}: {token!r} has a camera_intrinsic whose focal "
            "length is not within "
            f"{FOCALS[0]:g} and {FOCALS[1]:g} pixels"
        )
    if not all(0 <= middle <= size for middle, size in zip(intrinsic[:2, 2], PICTURE, strict=True)):
        raise InvalidInput(
            f"{database.path('calibrated_sensor')}: {token!r} has a camera_intrinsic whose "
            "principal point lies "
            f"outside the picture of {PICTURE[0]} x {PICTURE[1]}"
        )
    # The camera's own axes are z forward, x right, y down.
    mount = frame_of(database, "calibrated_sensor", row)
    turn = lidar.rotation.inv() * mount.rotation * _CAMERA_FROM_FORWARD
    frame = Frame.turned_by(turn, lidar.vectors_to_local(mount.origin - lidar.origin))
    (focal, _, u), (_, _, v), _ = intrinsic.tolist()
    return RecordedCamera(frame, focal, (u, v))


OWN, SWEEP = CAMERA_TIMES = ("own", "sweep")
"""Each camera at its own time, or all at that of the sweep."""
MOST_APART_S = 0.5
"""A keyframe: ten times as far as a picture of nuScenes is from its sweep."""


class Pictures(NamedTuple):
    """The pictures of a keyframe, one per camera: the LiDAR's frame when each was taken, and
    `timing` (k, 2). Timing is the age in seconds and the car's yaw change since.

    The cameras take turns, each when the sweep passes its view, and the car drives on: at 9 m/s the
    first picture is 0.4 m behind the sweep. Each picture uses the LiDAR's frame at its own time.
    Its detections have an age and a yaw change, so that wedges are turned back as for late cameras.
    Two effects are neglected. Boxes are those of the sweep's time, though objects may move within
    50 ms. A wedge has no depth, so it cannot be moved by the car's way.
    """

    moments: list[Frame]
    timing: Floats


def pictures_of(
    database: Database,
    sample: JsonRow,
    recordings: Sequence[JsonRow],
    lidar: Frame,
    sensor: Frame,
    camera_times: str = OWN,
) -> Pictures:
    """The pictures in the `recordings` of a sample. `lidar` is the LiDAR's frame in the car,
    `sensor` that in the world at the sweep.

    Raises InvalidInput for a picture without a pose, or far from its sample in time.
    """
    if camera_times == SWEEP:
        return Pictures([sensor] * len(recordings), np.zeros((len(recordings), 2)))
    cars = [frame_of(database, "ego_pose", database.pose_of(row)) for row in recordings]
    moments = [car.holding(lidar.origin, lidar.rotation) for car in cars]
    ages = np.array([sample["timestamp"] - row["timestamp"] for row in recordings]) * 1e-6
    for row, age in zip(recordings, ages.tolist(), strict=True):
        if abs(age) > MOST_APART_S:
            raise InvalidInput(
                f"{database.path('sample_data')}: {row['token']!r} was taken {abs(age):g} s from "
                f"its sample, may be {MOST_APART_S:g} s (timestamps are microseconds)"
            )
    turns = sensor.yaw - np.array([moment.yaw for moment in moments])
    turns = (turns + np.pi) % (2 * np.pi) - np.pi
    # The last picture of a keyframe may be taken a millisecond after the sweep.
    return Pictures(moments, np.column_stack([np.maximum(ages, 0.0), turns]))
