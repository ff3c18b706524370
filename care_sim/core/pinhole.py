"""A pinhole camera fixed to the car: pixels to directions and back.

Image frame: u right, v down, in pixels, (0, 0) the outer corner of the top-left pixel. Camera
directions are expressed in the sensor frame (x forward, y left, z up) of the LiDAR.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from care_sim.base.bounds import bounded, check_fields
from care_sim.base.checks import check_number
from care_sim.base.errors import InvalidInput
from care_sim.base.text import shown
from care_sim.core.frames import Floats, Frame

NEAR_M = 0.1
"""Nothing nearer to the image plane than this is seen."""
MOST_PIXELS = 2**14
"""A side of a picture: of the largest a gigabyte of numbers."""
FARTHEST_M = 1000.0
"""A camera of the car lies within this of its LiDAR."""
_TURNS = 100 * np.pi
"""Angles may go round, as long as a float tells them apart."""


@dataclass(frozen=True)
class PinholeCamera:
    """Intrinsics and extrinsics of one camera.

    `position` is the optical centre in the sensor frame (metres); `yaw` turns the optical axis
    about z, `pitch` raises it and `roll` lowers the camera's right (radians). `horizontal_fov` in radians.
    """

    width: int = bounded(320, 1, MOST_PIXELS)
    height: int = bounded(180, 1, MOST_PIXELS)
    horizontal_fov: float = bounded(np.pi / 2, 0.001, 3.14)
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw: float = bounded(0.0, -_TURNS, _TURNS)
    pitch: float = bounded(0.0, -_TURNS, _TURNS)
    roll: float = bounded(0.0, -_TURNS, _TURNS)

    def __post_init__(self) -> None:
        check_fields(self, " of the camera")
        if not (isinstance(self.position, tuple | list | np.ndarray) and len(self.position) == 3):
            raise InvalidInput(f"position of the camera must be x, y and z in metres, got {shown(self.position)}")
        for metres in self.position:
            check_number("position of the camera", metres, -FARTHEST_M, FARTHEST_M)

    @property
    def focal(self) -> float:
        """Focal length in pixels."""
        return float(self.width / 2 / np.tan(self.horizontal_fov / 2))

    @cached_property
    def axes(self) -> Floats:
        """(3, 3): rows are forward, left and up of the camera in the sensor frame."""
        cy, sy, cp, sp = np.cos(self.yaw), np.sin(self.yaw), np.cos(self.pitch), np.sin(self.pitch)
        upright = np.array([[cp * cy, cp * sy, sp], [-sy, cy, 0.0], [-sp * cy, -sp * sy, cp]])
        if not self.roll:
            return upright
        cr, sr = np.cos(self.roll), np.sin(self.roll)
        rolled: Floats = np.array([[1.0, 0.0, 0.0], [0.0, cr, sr], [0.0, -sr, cr]]) @ upright
        return rolled

    def stance(self, sensor: Frame) -> tuple[Floats, Floats]:
        """World position (3,), and rows (3, 3) forward, left and up in the world, of the camera on a sensor there."""
        return sensor.origin + sensor.vectors_to_world(np.array(self.position)), sensor.vectors_to_world(self.axes)

    def project(self, points: ArrayLike) -> tuple[Floats, Floats]:
        """Pixels (..., 2) and depths (...) of sensor-frame points (..., 3).

        Points at or behind the image plane have depth <= 0 and NaN pixels.
        """
        from care_sim.core.pinhole_kernels import project

        points = np.ascontiguousarray(points, dtype=float)
        pixels, depths = project(points.reshape(-1, 3), self._lens)
        return pixels.reshape(*points.shape[:-1], 2), depths.reshape(points.shape[:-1])

    def rays(self, pixels: ArrayLike) -> Floats:
        """Directions (..., 3), not normalised, through pixels (..., 2), in the sensor frame."""
        from care_sim.core.pinhole_kernels import rays

        pixels = np.ascontiguousarray(pixels, dtype=float)
        directions: Floats = rays(pixels.reshape(-1, 2), self._lens).reshape(*pixels.shape[:-1], 3)
        return directions

    def box_rays(self, boxes: ArrayLike) -> Floats:
        """(n, 9, 3) rays through image boxes (n, 4: left, top, right, bottom).

        Centre first, then the corners (paper, Algorithm 2), then the points of the edges nearest
        to the principal point, where azimuth and elevation of a wide box are extreme.
        """
        boxes = np.asarray(boxes, dtype=float).reshape(-1, 4)
        return CameraModels.of([self]).box_rays(boxes, np.zeros(len(boxes), np.int64))

    def project_boxes(self, boxes: Floats) -> Floats:
        """(n, 4) left, top, right, bottom of 3D boxes (n, 7) in pixels, beyond the picture where they reach
        beyond it; NaN for a box wholly behind NEAR_M. A box that crosses that plane is cut there.
        """
        from care_sim.core.pinhole_kernels import rectangles

        spans: Floats = rectangles(np.ascontiguousarray(boxes, dtype=float), self._lens, NEAR_M)
        return spans

    @cached_property
    def _lens(self) -> tuple[Floats, Floats, float, Floats]:
        centre = np.array([self.width / 2, self.height / 2])
        return np.array(self.position, dtype=float), self.axes, self.focal, centre


class CameraModels(NamedTuple):
    """The pinhole model of k cameras: `positions` (k, 3), `axes` (k, 3, 3), `focals` (k,) and `centres` (k, 2) as in
    `care_sim.core.pinhole_kernels`.
    """

    positions: Floats
    axes: Floats
    focals: Floats
    centres: Floats

    @classmethod
    def of(cls, cameras: Sequence[PinholeCamera]) -> "CameraModels":
        """Those of k cameras, of which there may be none."""
        shapes = (3,), (3, 3), (), (2,)
        columns = ([camera._lens[n] for camera in cameras] for n in range(len(shapes)))
        arrays = (np.array(column, float) for column in columns)
        return cls(*(array.reshape(-1, *shape) for array, shape in zip(arrays, shapes, strict=True)))

    def box_rays(self, boxes: Floats, cameras: NDArray[np.int64]) -> Floats:
        """As `PinholeCamera.box_rays`, of boxes (n, 4) in the pictures of `cameras` (n,), by number."""
        from care_sim.core.pinhole_kernels import box_rays

        bundles: Floats = box_rays(np.ascontiguousarray(boxes), np.ascontiguousarray(cameras), self)
        return bundles
