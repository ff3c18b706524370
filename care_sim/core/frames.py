"""A frame of reference: where a car or a sensor is, and how it is turned."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

Pose = tuple[float, float, float]
"""x, y (metres, world frame) and heading (radians, from x towards y) of a body on the ground."""

_Place = tuple[float, float, float, float]
_Number = TypeVar("_Number", float, Floats)

FULL_TURN = 2 * np.pi + 1e-6
"""Larger angles are degrees, or no angles."""


def mounted_at(
    place: tuple[_Number, _Number], turn: tuple[_Number, _Number], at: tuple[float, float, float]
) -> tuple[_Number, _Number]:
    """Return world x and y of a thing mounted `at` (x, y, z) in the frame of a body. The body is at
    a `place` on the ground, and `turn` is the cosine and the sine of its yaw. Takes one body, or
    many as columns.
    """
    (x, y), (cos, sin), (ahead, left, _) = place, turn, at
    return x + (cos * ahead - sin * left), y + (sin * ahead + cos * left)


def turned(vectors: Floats, yaw: float | Floats) -> Floats:
    """Vectors (..., k) turned by `yaw` radians about z: one angle, or one each. x and y come first;
    the other numbers stay as they are.
    """
    # Written out: a matrix product may round differently from one processor to the next. The sines
    # and cosines are NumPy's, also where compiled code takes them.
    cos, sin = np.cos(yaw), np.sin(yaw)
    if not isinstance(yaw, np.ndarray):
        table = np.ascontiguousarray(vectors, dtype=float)
        turn = float(cos), float(sin)
        return turned_alike(table.reshape(-1, table.shape[-1]), turn).reshape(table.shape)
    result: Floats = np.array(vectors, dtype=float)
    x, y = vectors[..., 0], vectors[..., 1]
    result[..., 0] = cos * x - sin * y
    result[..., 1] = sin * x + cos * y
    return result


@compiled()
def turned_alike(vectors: Floats, turn: tuple[float, float]) -> Floats:
    """Vectors (n, k) turned by the angle with this cosine and sine; see `turned`."""
    result = vectors.copy()
    cos, sin = turn
    for one in result:
        x, y = one[0], one[1]
        one[0], one[1] = cos * x - sin * y, sin * x + cos * y
    return result


_LOCKED = 1 - 1e-13
"""Sine of a pitch (89.99997 degrees) at which yaw and roll turn about one axis: all of it counts as
yaw.
"""


@dataclass(frozen=True)
class Frame:
    """Origin (world x, y, z in metres) and orientation of a frame (radians; ISO 8855). The frame
    turns by `yaw` about z, then by `pitch` about its own y, which lowers its front. Last it turns
    by `roll` about its own x, which lowers its right.
    """

    x: float
    y: float
    z: float
    yaw: float
    roll: float = 0.0
    pitch: float = 0.0

    @classmethod
    def mounted(cls, pose: Pose, at: tuple[float, float, float]) -> "Frame":
        """The frame of a sensor mounted `at` (x, y, z) in the frame of a body at `pose`."""
        x, y, yaw = pose
        turn = float(np.cos(yaw)), float(np.sin(yaw))
        return cls(*mounted_at((x, y), turn, at), at[2], yaw)

    @classmethod
    def turned_by(cls, rotation: "Rotation", origin: Floats) -> "Frame":
        """The frame at `origin` (3,) whose axes are those of the world after `rotation`."""
        # The part of the frame's x axis that points down is the sine of its pitch.
        i, j, k, w = rotation.as_quat().tolist()
        lowers = 2 * (w * j - i * k)
        if abs(lowers) > _LOCKED:
            # The angles of such a rotation are not unique: with roll 0, yaw is where left points.
            left = rotation.as_matrix()[:, 1].tolist()
            yaw = math.atan2(-left[0], left[1])
            roll = 0.0
            pitch = math.copysign(math.pi / 2, lowers)
        else:
            yaw, pitch, roll = rotation.as_euler("ZYX").tolist()
        x, y, z = origin.tolist()
        return cls(x, y, z, yaw, roll, pitch)

    def holding(self, origin: Floats, rotation: "Rotation | None" = None) -> "Frame":
        """The world frame of what is fixed in this one at `origin` (3,), turned by `rotation`."""
        turn = self.rotation if rotation is None else self.rotation * rotation
        return Frame.turned_by(turn, self.origin + self.vectors_to_world(origin))

    def seeing(self, other: "Frame") -> "Frame":
        """Another world frame, seen in this one."""
        turn = self.rotation.inv() * other.rotation
        return Frame.turned_by(turn, self.vectors_to_local(other.origin - self.origin))

    @property
    def origin(self) -> Floats:
        """(3,) world position."""
        return np.array([self.x, self.y, self.z])

    @cached_property
    def turn_back(self) -> tuple[float, float]:
        """Cosine and sine of -yaw, which turns vectors on the ground into the frame's axes."""
        # NumPy's, as in `turned`.
        return float(np.cos(-self.yaw)), float(np.sin(-self.yaw))

    @cached_property
    def rotation(self) -> "Rotation":
        """From the axes of this frame to those of the world."""
        from scipy.spatial.transform import Rotation

        return Rotation.from_euler("ZYX", [self.yaw, self.pitch, self.roll])

    def vectors_to_world(self, vectors: Floats) -> Floats:
        """Vectors (..., 3) of this frame along the axes of the world."""
        return turned(vectors, self.yaw) if self._upright else vectors @ self.rotation.as_matrix().T

    def vectors_to_local(self, vectors: Floats) -> Floats:
        """World vectors (..., 3) along the axes of this frame."""
        return turned(vectors, -self.yaw) if self._upright else vectors @ self.rotation.as_matrix()

    def points_of(self, other: "Frame", points: Floats) -> Floats:
        """Points (n, 3) of another frame in this one."""
        return self.vectors_to_local(other.origin + other.vectors_to_world(points) - self.origin)

    def boxes_of(self, other: "Frame", boxes: Floats) -> Floats:
        """Boxes (n, 7) of another frame in this one; see `boxes_to_local`."""
        return boxes if self == other else self.boxes_to_local(other.boxes_to_world(boxes))

    def boxes_to_local(self, boxes: Floats) -> Floats:
        """World boxes (n, 7) seen in this frame: exact centres, headings projected on its x, y
        plane.
        """
        if self._upright:
            table = np.ascontiguousarray(boxes, dtype=float)
            return seen_from(table, self.turn_back, self._place)
        centres = self.vectors_to_local(boxes[:, :3] - self.origin)
        return _boxes_turned(boxes, centres, self.vectors_to_local)

    def boxes_to_world(self, boxes: Floats) -> Floats:
        """Boxes (n, 7) of this frame in the world: exact centres, headings projected on the
        ground.
        """
        if self._upright:
            turn = float(np.cos(self.yaw)), float(np.sin(self.yaw))
            return placed_at(np.ascontiguousarray(boxes, dtype=float), turn, self._place)
        centres = self.origin + self.vectors_to_world(boxes[:, :3])
        return _boxes_turned(boxes, centres, self.vectors_to_world)

    # A car on level ground is by far the most frequent frame, and needs no matrices.
    @property
    def _upright(self) -> bool:
        return self.roll == 0 and self.pitch == 0

    @property
    def _place(self) -> _Place:
        # Floats, so that compiled code is compiled once.
        return float(self.x), float(self.y), float(self.z), float(self.yaw)


# The sines and cosines are handed over: as in `turned` they are NumPy's, on every machine.
@compiled()
def seen_from(boxes: Floats, turn: tuple[float, float], place: _Place) -> Floats:
    """World boxes (n, 7) seen from a `place` (x, y, z, yaw) on the ground; `turn` is the cosine and
    the sine of -yaw.
    """
    seen = boxes.copy()
    cos, sin = turn
    for box in seen:
        x, y = box[0] - place[0], box[1] - place[1]
        box[0], box[1] = cos * x - sin * y, sin * x + cos * y
        box[2] -= place[2]
        box[6] -= place[3]
    return seen


@compiled()
def placed_at(boxes: Floats, turn: tuple[float, float], place: _Place) -> Floats:
    """Boxes (n, 7) seen from a `place` (x, y, z, yaw) in the world; `turn` is the cosine and the
    sine of yaw.
    """
    placed = boxes.copy()
    cos, sin = turn
    for box in placed:
        x, y = box[0], box[1]
        box[0], box[1] = cos * x - sin * y + place[0], sin * x + cos * y + place[1]
        box[2] += place[2]
        box[6] += place[3]
    return placed


def _boxes_turned(boxes: Floats, centres: Floats, turn: Callable[[Floats], Floats]) -> Floats:
    """Boxes of the same sizes at `centres` (n, 3), their headings turned by `turn`."""
    # A box keeps one angle: the direction in the plane of its heading, turned in space.
    yaw = boxes[:, 6]
    heading = turn(np.column_stack([np.cos(yaw), np.sin(yaw), np.zeros(len(yaw))]))
    return np.column_stack([centres, boxes[:, 3:6], np.arctan2(heading[:, 1], heading[:, 0])])
