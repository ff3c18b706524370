"""The cameras of a recorded car, and what they saw when no detector was run: projected boxes with
visibility.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from care_sim.core.arrays import Floats
from care_sim.core.frames import Frame
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.types import ImageDetections
from care_sim.sensors.annotated import Annotations, IdentifiedDetections
from care_sim.sensors.pictures import CAMERA_HEIGHT, CAMERA_WIDTH, MIN_PIXELS, confidence_of
from care_sim.sensors.surround import View

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


def recorded_camera(mount: Frame, intrinsic: Floats, lidar: Frame) -> RecordedCamera:
    """From frames in the car: the camera's (z forward, x right, y down) and the LiDAR's sensor
    frame.
    """
    # From axes x forward, y left, z up to those of the camera.
    ahead = Rotation.from_matrix([[0, -1, 0], [0, 0, -1], [1, 0, 0]])
    turn = lidar.rotation.inv() * mount.rotation * ahead
    frame = Frame.turned_by(turn, lidar.vectors_to_local(mount.origin - lidar.origin))
    return RecordedCamera(
        frame, float(intrinsic[0, 0]), (float(intrinsic[0, 2]), float(intrinsic[1, 2]))
    )


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
