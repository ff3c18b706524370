"""A pinhole camera fixed to the car: pixels to directions and back.

Image frame: u right, v down, in pixels, (0, 0) the outer corner of the top-left pixel. Camera
directions are expressed in the sensor frame (x forward, y left, z up) of the LiDAR.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from care_sim.frames import BOX_EDGES, Floats, box_corners

NEAR_M = 0.1
"""Nothing nearer to the image plane than this is seen."""

_BOTH_WAYS = np.concatenate([BOX_EDGES, BOX_EDGES[:, ::-1]])
_BOX_POINTS = np.array([(4, 5), (0, 1), (0, 3), (2, 1), (2, 3), (6, 1), (6, 3), (0, 7), (2, 7)])
"""Points (column, row) of an image box among its left, top, right, bottom, its centre, and its u and v nearest to the
principal point."""


@dataclass(frozen=True)
class PinholeCamera:
    """Intrinsics and extrinsics of one camera.

    `position` is the optical centre in the sensor frame (metres); `yaw` turns the optical axis
    about z, `pitch` raises it and `roll` lowers the camera's right (radians). `horizontal_fov` in radians.
    """

    width: int = 320
    height: int = 180
    horizontal_fov: float = np.pi / 2
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0

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

    def project(self, points: ArrayLike) -> tuple[Floats, Floats]:
        """Pixels (..., 2) and depths (...) of sensor-frame points (..., 3).

        Points at or behind the image plane have depth <= 0 and NaN pixels.
        """
        return self._lens.project(np.asarray(points, dtype=float))

    def rays(self, pixels: ArrayLike) -> Floats:
        """Directions (..., 3), not normalised, through pixels (..., 2), in the sensor frame."""
        return self._lens.rays(np.asarray(pixels, dtype=float))

    def box_rays(self, boxes: ArrayLike) -> Floats:
        """(n, 9, 3) rays through image boxes (n, 4: left, top, right, bottom).

        Centre first, then the corners (paper, Algorithm 2), then the points of the edges nearest
        to the principal point, where azimuth and elevation of a wide box are extreme.
        """
        return self._lens.box_rays(np.asarray(boxes, dtype=float).reshape(-1, 4))

    def project_boxes(self, boxes: Floats) -> Floats:
        """(n, 4) left, top, right, bottom of 3D boxes (n, 7) in pixels, beyond the picture where they reach
        beyond it; NaN for a box wholly behind NEAR_M. A box that crosses that plane is cut there.
        """
        corners = (box_corners(boxes) - self.position) @ self.axes.T
        points = _cut(corners[:, _BOTH_WAYS[:, 0]], corners[:, _BOTH_WAYS[:, 1]])
        pixels = self._lens.centres - self.focal * points[..., 1:] / points[..., :1]
        return np.concatenate([np.fmin.reduce(pixels, axis=1), np.fmax.reduce(pixels, axis=1)], axis=1)

    @cached_property
    def _lens(self) -> "Lenses":
        centre = np.array([self.width / 2, self.height / 2])
        return Lenses(np.array(self.position, dtype=float), self.axes, np.array(self.focal), centre)


@dataclass(frozen=True)
class Lenses:
    """The pinhole model of one camera or, with an axis of n before each column, of n at once.

    `positions` (3,) and `axes` (3, 3) in the sensor frame, `focals` () and `centres` (2,) in pixels.
    """

    positions: Floats
    axes: Floats
    focals: Floats
    centres: Floats

    @classmethod
    def of(cls, cameras: Sequence[PinholeCamera]) -> "Lenses":
        """Those of n cameras."""
        lenses = [camera._lens for camera in cameras]
        return cls(*(np.array([getattr(lens, column.name) for lens in lenses]) for column in fields(cls)))

    def take(self, numbers: NDArray[np.int64]) -> "Lenses":
        """(n, 1, ...) the lenses of n lists of points or boxes, by number."""
        positions, focals, centres = (column[numbers, None] for column in (self.positions, self.focals, self.centres))
        return Lenses(positions, self.axes[numbers], focals, centres)

    def project(self, points: Floats) -> tuple[Floats, Floats]:
        """As `PinholeCamera.project`."""
        local = (points - self.positions) @ np.swapaxes(self.axes, -1, -2)
        depth = local[..., 0]
        scale = self.focals / np.where(depth > 0, depth, np.nan)
        return self.centres - local[..., 1:] * scale[..., None], depth

    def rays(self, pixels: Floats) -> Floats:
        """As `PinholeCamera.rays`."""
        local = np.ones((*pixels.shape[:-1], 3))
        local[..., 1:] = (self.centres - pixels) / self.focals[..., None]
        return local @ self.axes

    def box_rays(self, boxes: Floats) -> Floats:
        """As `PinholeCamera.box_rays`."""
        low, high = boxes[:, :2], boxes[:, 2:]
        nearest = np.minimum(np.maximum(self.centres.reshape(-1, 2), low), high)
        return self.rays(np.concatenate([boxes, (low + high) / 2, nearest], axis=1)[:, _BOX_POINTS])


def _cut(points: Floats, others: Floats) -> Floats:
    """`points` (..., 3: depth, left, up), moved along the line to `others` up to NEAR_M; NaN if both lie behind."""
    depth, far = points[..., 0], others[..., 0]
    behind = depth < NEAR_M
    span = np.where(behind & (far >= NEAR_M), far - depth, np.nan)
    share = np.where(behind, (NEAR_M - depth) / span, 0.0)
    return points + (others - points) * share[..., None]
