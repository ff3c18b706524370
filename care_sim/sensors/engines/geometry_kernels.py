"""Vectors and turns that the kernels of rays and of pictures share, compiled."""

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats

Vector = tuple[float, float, float]
Axes = tuple[Vector, Vector, Vector]
"""Three unit vectors at right angles: the x, y and z axis of a frame, told in another."""


@compiled()
def dot(one: Vector | Floats, other: Vector | Floats) -> float:
    """The scalar product of two vectors (3,)."""
    product: float = one[0] * other[0] + one[1] * other[1] + one[2] * other[2]
    return product


@compiled()
def body_axes(x: float, y: float, z: float, w: float) -> Axes:
    """The axes that the unit quaternion (x, y, z, w) gives a body, in the world."""
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
        (2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
        (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
