"""A pinhole camera fixed to the car: pixels to directions and back.

Image frame: u right, v down, in pixels; (0, 0) is the outer corner of the top-left pixel. Camera
directions are expressed in the sensor frame (x forward, y left, z up) of the LiDAR.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from care_sim.base.checks import bounded, check_fields, checked_place
from care_sim.base.compiled import compiled
from care_sim.base.errors import InvalidInput, shown
from care_sim.core.arrays import Floats, Integers
from care_sim.core.frames import Frame


class CameraModel(NamedTuple):
    """One camera: `position` (3,) of its optical centre; `axes` (3, 3), whose rows are its forward,
    left and up; its `focal` length and principal point `centre` (2,) in pixels.
    """

    position: Floats
    axes: Floats
    focal: float
    centre: Floats


class MountedCameras(NamedTuple):
    """The k cameras of W cars, as they are mounted. `mounts` (W, k, 4, 3) are place and axes in the
    sensor frame. `focals` (k,), `centres` (k, 2) and `sizes` (k, 2: width, height) are in pixels.
    """

    mounts: Floats
    focals: Floats
    centres: Floats
    sizes: Integers


Numbers4 = tuple[float, float, float, float]

_BOX_POINTS = ((2, 2), (0, 0), (0, 1), (1, 0), (1, 1), (3, 0), (3, 1), (0, 3), (1, 3))
"""Points of an image box: which of low, high, middle and nearest to the principal point across, and
which down."""


@compiled()
def _project(points: Floats, camera: CameraModel) -> tuple[Floats, Floats]:
    """Pixels (n, 2) and depths (n,) of points (n, 3)."""
    pixels = np.empty((len(points), 2))
    depths = np.empty(len(points))
    for n, (x, y, z) in enumerate(points):
        pixels[n, 0], pixels[n, 1], depths[n] = pixel(x, y, z, camera)
    return pixels, depths


@compiled()
def _rays(pixels: Floats, camera: CameraModel) -> Floats:
    """Directions (n, 3), not normalised, through pixels (n, 2)."""
    directions = np.empty((len(pixels), 3))
    for n, (u, v) in enumerate(pixels):
        directions[n] = _ray(u, v, camera)
    return directions


@compiled()
def box_rays(boxes: Floats, numbers: Integers, cameras: MountedCameras) -> Floats:
    """(n, 9, 3) rays through image boxes (n, 4: left, top, right, bottom) of the cameras `numbers`
    (n,) of the first car; see `care_sim.core.pinhole.PinholeCamera.box_rays`.
    """
    # One ray per entry of `_BOX_POINTS`: each picks one of four places across and one of four down.
    bundles = np.empty((len(boxes), len(_BOX_POINTS), 3))
    for n, (left, top, right, bottom) in enumerate(boxes):
        camera = mounted_model(cameras, 0, numbers[n])
        centre = camera.centre
        # Azimuth and elevation of a box's points are extreme at its corners, or on an edge where it
        # passes nearest to the principal point.
        across = left, right, (left + right) / 2, min(max(centre[0], left), right)
        down = top, bottom, (top + bottom) / 2, min(max(centre[1], top), bottom)
        for k, (i, j) in enumerate(_BOX_POINTS):
            bundles[n, k] = _ray(across[i], down[j], camera)
    return bundles


@compiled()
def box_spans(boxes: Floats, camera: CameraModel, nearest: float) -> Floats:
    """(n, 4: left, top, right, bottom) what 3D boxes (n, 7) span in the picture, NaN for a box
    wholly behind the plane at the depth `nearest`; see
    `care_sim.core.pinhole.PinholeCamera.project_boxes`.
    """
    spans = np.full((len(boxes), 4), math.nan)
    corners = np.empty((8, 3))
    for n, box in enumerate(boxes):
        if _is_behind(box, camera, nearest):
            continue
        # Beyond the near plane, the picture of a box is the convex hull of those of its corners,
        # so these bound it.
        _lay_corners(box, camera, corners)
        span = math.inf, math.inf, -math.inf, -math.inf
        for one in range(8):
            if corners[one, 0] >= nearest:
                span = _widened(span, corners[one], camera)

            # An edge joins two corners that differ in one bit. Where it crosses the near plane, the
            # box is cut, and the cut is a point of its outline.
            for axis in range(3):
                other = one ^ 1 << axis
                if corners[one, 0] < nearest <= corners[other, 0]:
                    share = (nearest - corners[one, 0]) / (corners[other, 0] - corners[one, 0])
                    cut = corners[one] + (corners[other] - corners[one]) * share
                    span = _widened(span, cut, camera)
        if span[0] <= span[2]:
            spans[n, 0], spans[n, 1], spans[n, 2], spans[n, 3] = span
    return spans


@compiled()
def window_on(
    boxes: Floats, camera: CameraModel, nearest: float, width: int, height: int
) -> tuple[int, int, int, int]:
    """`window_around` what 3D boxes (n, 7) span; see `box_spans`."""
    kept = np.empty(boxes.shape)
    count = 0
    for n in range(len(boxes)):
        if not _is_beside(boxes[n], camera):
            kept[count] = boxes[n]
            count += 1
    return window_around(box_spans(kept[:count], camera, nearest), width, height)


@compiled()
def window_around(spans: Floats, width: int, height: int) -> tuple[int, int, int, int]:
    """Left, top, right, bottom: the whole pixels of a picture that hold `spans` (n, 4), and one
    more on each side. Spans of NaN are left out, and all 0 is a window that holds nothing.
    """
    # An empty window, the wrong way round: whatever is shown widens it.
    left, top = width, height
    right, bottom = 0, 0
    for span in spans:
        # A span of NaN fails this comparison.
        if span[0] <= span[2]:
            low = max(math.floor(span[0]) - 1, 0), max(math.floor(span[1]) - 1, 0)
            high = min(math.ceil(span[2]) + 1, width), min(math.ceil(span[3]) + 1, height)
            if low[0] < high[0] and low[1] < high[1]:
                left, top = min(left, low[0]), min(top, low[1])
                right, bottom = max(right, high[0]), max(bottom, high[1])
    return (left, top, right, bottom) if left < right else (0, 0, 0, 0)


@compiled(boundscheck=True)
def mounted_model(cameras: MountedCameras, world: int, number: int) -> CameraModel:
    """A camera of a car. Raises IndexError for a number that there is not."""
    mount = cameras.mounts[world, number]
    return CameraModel(mount[0], mount[1:], cameras.focals[number], cameras.centres[number])


@compiled()
def pixel(x: float, y: float, z: float, camera: CameraModel) -> tuple[float, float, float]:
    """Pixel u, v and depth of a point. At or behind the image plane there is no pixel: NaN."""
    position = camera.position
    axes = camera.axes
    centre = camera.centre
    x, y, z = x - position[0], y - position[1], z - position[2]

    # Depth is the part along the optical axis. A point appears as far from the principal point as
    # it lies off that axis, times the focal length over its depth. Pixels count to the right and
    # down, the axes of the camera to the left and up.
    depth = _along(axes[0], x, y, z)
    left, up = _along(axes[1], x, y, z), _along(axes[2], x, y, z)
    scale = camera.focal / depth if depth > 0 else math.nan
    return centre[0] - left * scale, centre[1] - up * scale, depth


@compiled()
def _ray(u: float, v: float, camera: CameraModel) -> tuple[float, float, float]:
    """The direction of a pixel, not normalised: its part along the optical axis is 1."""
    axes = camera.axes
    centre = camera.centre
    # At depth 1 the pixel lies this far to the left of the optical axis, and this far above it.
    left, up = (centre[0] - u) / camera.focal, (centre[1] - v) / camera.focal
    return (
        axes[0, 0] + left * axes[1, 0] + up * axes[2, 0],
        axes[0, 1] + left * axes[1, 1] + up * axes[2, 1],
        axes[0, 2] + left * axes[1, 2] + up * axes[2, 2],
    )


@compiled()
def _is_behind(box: Floats, camera: CameraModel, depth: float) -> bool:
    """Whether the ball that holds a box (7,) lies wholly before a depth: most boxes around a car
    are behind any one of its cameras.
    """
    place = camera.position
    x, y, z = box[0] - place[0], box[1] - place[1], box[2] - place[2]
    radius = math.sqrt(box[3] ** 2 + box[4] ** 2 + box[5] ** 2) / 2
    # A millimetre is room for rounding.
    return _along(camera.axes[0], x, y, z) + radius + 0.001 < depth


@compiled()
def _is_beside(box: Floats, camera: CameraModel) -> bool:
    """Whether the ball that holds a box (7,) lies wholly to one side of all that the picture and
    two columns more on either side show.
    """
    place = camera.position
    x, y, z = box[0] - place[0], box[1] - place[1], box[2] - place[2]
    ahead, left = _along(camera.axes[0], x, y, z), _along(camera.axes[1], x, y, z)
    # The plane through the camera and a column `off` from the principal point is
    # left * focal = off * ahead. A millimetre is room for rounding.
    off = camera.centre[0] + 2.0
    radius = math.sqrt(box[3] ** 2 + box[4] ** 2 + box[5] ** 2) / 2 + 0.001
    beyond = abs(left) * camera.focal - off * ahead
    return bool(beyond > radius * math.hypot(camera.focal, off))


@compiled()
def _lay_corners(box: Floats, camera: CameraModel, corners: Floats) -> None:
    """Fill `corners` (8, 3: depth, left, up in the camera) of a box (7,). Bit i of a corner's
    number says on which side of the box's axis i it lies.
    """
    position = camera.position
    axes = camera.axes
    cos, sin = math.cos(box[6]), math.sin(box[6])
    for n in range(8):
        # A bit less one half is the side: -0.5 or 0.5 of the length, the width and the height.
        along, across = box[3] * ((n & 1) - 0.5), box[4] * ((n >> 1 & 1) - 0.5)
        upward = box[5] * ((n >> 2) - 0.5)
        x = box[0] + cos * along - sin * across - position[0]
        y = box[1] + sin * along + cos * across - position[1]
        for i in range(3):
            corners[n, i] = _along(axes[i], x, y, box[2] + upward - position[2])


@compiled()
def _widened(span: Numbers4, point: Floats, camera: CameraModel) -> Numbers4:
    """A span (left, top, right, bottom), widened to hold the pixel of a point (depth, left, up)."""
    u = camera.centre[0] - camera.focal * point[1] / point[0]
    v = camera.centre[1] - camera.focal * point[2] / point[0]
    return min(span[0], u), min(span[1], v), max(span[2], u), max(span[3], v)


@compiled()
def _along(axis: NDArray[np.float64], x: float, y: float, z: float) -> float:
    """The part of (x, y, z) along an axis (3,)."""
    part: float = axis[0] * x + axis[1] * y + axis[2] * z
    return part


NEAR_M = 0.1
"""Nothing nearer to the image plane than this is seen."""
MOST_PIXELS = 2**14
"""A side of a picture: the largest picture is a gigabyte of numbers."""
FARTHEST_M = 1000.0
"""A camera of the car lies within this of its LiDAR."""
_MOST_RADIANS = 100 * np.pi
"""Angles may go round, as long as floats distinguish them."""


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
        place = checked_place("position of the camera", self.position, (-FARTHEST_M, FARTHEST_M))
        object.__setattr__(self, "position", place)

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
        pixels, depths = _project(points.reshape(-1, 3), self._model)
        return pixels.reshape(*points.shape[:-1], 2), depths.reshape(points.shape[:-1])

    def rays(self, pixels: ArrayLike) -> Floats:
        """Directions (..., 3), not normalised, through pixels (..., 2), in the sensor frame."""
        pixels = np.ascontiguousarray(pixels, dtype=float)
        return _rays(pixels.reshape(-1, 2), self._model).reshape(*pixels.shape[:-1], 3)

    def box_rays(self, boxes: ArrayLike) -> Floats:
        """(n, 9, 3) rays through image boxes (n, 4: left, top, right, bottom).

        The centre comes first, then the corners (paper, Algorithm 2). The last four are the points
        of the edges nearest to the principal point, where azimuth and elevation of a wide box are
        extreme.
        """
        boxes = np.ascontiguousarray(boxes, dtype=float).reshape(-1, 4)
        return box_rays(boxes, np.zeros(len(boxes), np.int64), mounted_cameras(1, [self]))

    def project_boxes(self, boxes: Floats) -> Floats:
        """(n, 4) left, top, right, bottom of 3D boxes (n, 7) in pixels, beyond the picture where
        they reach beyond it. NaN for a box wholly behind NEAR_M; a box that crosses that plane is
        cut there.
        """
        return box_spans(np.ascontiguousarray(boxes, dtype=float), self._model, NEAR_M)

    def window_on(self, boxes: Floats) -> tuple[int, int, int, int]:
        """Return the rectangle of the picture that holds 3D boxes (n, 7), with a pixel more on each
        side. It is left, top, right and bottom in whole pixels, all 0 if no box is in view.
        """
        boxes = np.ascontiguousarray(boxes, dtype=float)
        window: tuple[int, int, int, int] = window_on(
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


def mounted_cameras(worlds: int, cameras: Sequence[PinholeCamera]) -> MountedCameras:
    """The same k cameras, of which there may be none, on so many cars."""
    models = [camera._model for camera in cameras]
    mounts = np.array([(one.position, *one.axes) for one in models], float).reshape(-1, 4, 3)
    return MountedCameras(
        np.tile(mounts, (worlds, 1, 1, 1)),
        np.array([one.focal for one in models], float),
        np.array([one.centre for one in models], float).reshape(-1, 2),
        np.array([(one.width, one.height) for one in cameras], np.int64).reshape(-1, 2),
    )
