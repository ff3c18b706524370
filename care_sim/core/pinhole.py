"""A pinhole camera fixed to the car: pixels to directions and back.

Image frame: u right, v down, in pixels; (0, 0) is the outer corner of the top-left pixel. Camera
directions are expressed in the sensor frame (x forward, y left, z up) of the LiDAR.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from care_sim.base.bounds import bounded, check_fields
from care_sim.base.checks import check_number
from care_sim.base.errors import InvalidInput, shown
from care_sim.core import pinhole_kernels as kernels
from care_sim.core.arrays import Floats
from care_sim.core.frames import Frame
from care_sim.core.pinhole_kernels import CameraModel, CameraModels

NEAR_M = 0.1
"""Nothing nearer to the image plane than this is seen."""
MOST_PIXELS = 2**14
"""A side of a picture: the largest picture is a gigabyte of numbers."""
FARTHEST_M = 1000.0
"""A camera of the car lies within this of its LiDAR."""
_MOST_RADIANS = 100 * np.pi
"""Angles may go round, as long as a float tells them apart."""


@dataclass(frozen=True)
class PinholeCamera:
    """Intrinsics and extrinsics of one camera.

    `width` and `height` are in pixels, `horizontal_fov` in radians. `position` is the optical
    centre in the sensor frame (metres). `yaw` turns the optical axis about z, `pitch` raises it,
    and `roll` lowers the camera's right (radians). Raises InvalidInput for a value out of its
    bounds.
    """

    width: int = bounded(320, 1, MOST_PIXELS)
    height: int = bounded(180, 1, MOST_PIXELS)
    horizontal_fov: float = bounded(np.pi / 2, 0.001, 3.14)
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw: float = bounded(0.0, -_MOST_RADIANS, _MOST_RADIANS)
    pitch: float = bounded(0.0, -_MOST_RADIANS, _MOST_RADIANS)
    roll: float = bounded(0.0, -_MOST_RADIANS, _MOST_RADIANS)

    def __post_init__(self) -> None:
        check_fields(self, " of the camera")
        if not (isinstance(self.position, tuple | list | np.ndarray) and len(self.position) == 3):
            raise InvalidInput(
                f"position of the camera must be x, y and z in metres, got {shown(self.position)}"
            )
        for metres in self.position:
            check_number("position of the camera", metres, -FARTHEST_M, FARTHEST_M)

    @cached_property
    def focal(self) -> float:
        """Focal length in pixels."""
        return float(self.width / 2 / np.tan(self.horizontal_fov / 2))

    @cached_property
    def axes(self) -> Floats:
        """(3, 3): rows are forward, left and up of the camera in the sensor frame."""
        cy, sy = np.cos(self.yaw), np.sin(self.yaw)
        cp, sp = np.cos(self.pitch), np.sin(self.pitch)
        upright = np.array([[cp * cy, cp * sy, sp], [-sy, cy, 0.0], [-sp * cy, -sp * sy, cp]])
        if not self.roll:
            return upright
        # Roll turns left and up about the optical axis, which it leaves as it is.
        cr, sr = np.cos(self.roll), np.sin(self.roll)
        rolled: Floats = np.array([[1.0, 0.0, 0.0], [0.0, cr, sr], [0.0, -sr, cr]]) @ upright
        return rolled

    def stance(self, sensor: Frame) -> tuple[Floats, Floats]:
        """World position (3,) of the camera on a sensor at the frame `sensor`, and (3, 3) its axes
        in the world: rows are forward, left and up.
        """
        mounting = sensor.vectors_to_world(self._mounting)
        return sensor.origin + mounting[0], mounting[1:]

    @cached_property
    def _mounting(self) -> Floats:
        """(4, 3) position and axes in the sensor frame."""
        return np.vstack([self.position, self.axes])

    def project(self, points: ArrayLike) -> tuple[Floats, Floats]:
        """Pixels (..., 2) and depths (...) of sensor-frame points (..., 3).

        Points at or behind the image plane have depth <= 0 and NaN pixels.
        """
        # Kernels are compiled for one layout, contiguous float64; anything else is copied to it.
        points = np.ascontiguousarray(points, dtype=float)
        pixels, depths = kernels.project(points.reshape(-1, 3), self._model)
        return pixels.reshape(*points.shape[:-1], 2), depths.reshape(points.shape[:-1])

    def rays(self, pixels: ArrayLike) -> Floats:
        """Directions (..., 3), not normalised, through pixels (..., 2), in the sensor frame."""
        pixels = np.ascontiguousarray(pixels, dtype=float)
        return kernels.rays(pixels.reshape(-1, 2), self._model).reshape(*pixels.shape[:-1], 3)

    def box_rays(self, boxes: ArrayLike) -> Floats:
        """(n, 9, 3) rays through image boxes (n, 4: left, top, right, bottom).

        The centre comes first, then the corners (paper, Algorithm 2). The last four are the points
        of the edges nearest to the principal point, where azimuth and elevation of a wide box are
        extreme.
        """
        boxes = np.ascontiguousarray(boxes, dtype=float).reshape(-1, 4)
        return kernels.box_rays(boxes, np.zeros(len(boxes), np.int64), camera_models([self]))

    def project_boxes(self, boxes: Floats) -> Floats:
        """(n, 4) left, top, right, bottom of 3D boxes (n, 7) in pixels, beyond the picture where
        they reach beyond it. NaN for a box wholly behind NEAR_M; a box that crosses that plane is
        cut there.
        """
        return kernels.box_spans(np.ascontiguousarray(boxes, dtype=float), self._model, NEAR_M)

    def window_on(self, boxes: Floats) -> tuple[int, int, int, int]:
        """Left, top, right and bottom in whole pixels: the rectangle of the picture that holds 3D
        boxes (n, 7), with a pixel more on each side; all 0 when none is in view.
        """
        boxes = np.ascontiguousarray(boxes, dtype=float)
        window: tuple[int, int, int, int] = kernels.window_on(
            boxes, self._model, NEAR_M, self.width, self.height
        )
        return window

    @cached_property
    def _model(self) -> CameraModel:
        centre = np.array([self.width / 2, self.height / 2])
        return CameraModel(np.array(self.position, dtype=float), self.axes, self.focal, centre)


def checked_cameras(cameras: object, of: str = "") -> tuple[PinholeCamera, ...]:
    """Cameras as a tuple. Raises InvalidInput, which names what they are `of`, for anything but a
    tuple or list of them.
    """
    if not (
        isinstance(cameras, tuple | list)
        and all(isinstance(camera, PinholeCamera) for camera in cameras)
    ):
        raise InvalidInput(f"cameras{of} must be PinholeCameras, got {shown(cameras)}")
    return tuple(cameras)


def camera_models(cameras: Sequence[PinholeCamera]) -> CameraModels:
    """The models of k cameras, of which there may be none, as one table."""
    models = [camera._model for camera in cameras]
    return CameraModels(
        np.array([model.position for model in models], float).reshape(-1, 3),
        np.array([model.axes for model in models], float).reshape(-1, 3, 3),
        np.array([model.focal for model in models], float),
        np.array([model.centre for model in models], float).reshape(-1, 2),
    )
