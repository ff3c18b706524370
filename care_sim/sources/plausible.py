"""What a recording can hold: the ranges of boxes, poses and times, alike for every source.

They are wide. What lies beyond is damage. Further on it would become infinities and NaN, or a body
that ends Bullet (a round one without a radius does).
"""

from pathlib import Path

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats

ValueRange = tuple[float, float]

SIZES_M: ValueRange = (0.01, 200.0)
"""Length, width and height of an annotated box: a tenth of the smallest, and twice the longest
train in a street.
"""
AWAY_M: ValueRange = (-1e4, 1e4)
"""x, y and z of an annotated box from the car: forty times as far as boxes are annotated."""
MAP_M: ValueRange = (-1e8, 1e8)
"""x, y and z in a map: more than twice round the Earth, and yet a float tells a micrometre."""
MOUNT_M: ValueRange = (-100.0, 100.0)
"""x, y and z of a sensor in its car, which may be a road train."""
REACH_M: ValueRange = (-500.0, 500.0)
"""x, y and z of a point from its sensor: farther than any LiDAR reaches."""
STAMPS_NS: ValueRange = (0, 2**62)
"""Nanoseconds since 1970, until 2116: differences stay within 64 bits."""
LONGEST_S = 86_400
"""A drive lasts a day."""
MOST_PITCH = np.radians(80)
"""Radians that a car or a box may be pitched: what points straight up has no heading."""
UNIT = (0.9, 1.1)
"""The length of a quaternion that was rounded."""


def check_span(path: Path | str, seconds: float) -> None:
    """Raise InvalidInput for a drive longer than `LONGEST_S`."""
    if seconds > LONGEST_S:
        raise InvalidInput(
            f"{path}: its times span {seconds:g} s, and a drive may last {LONGEST_S} s"
        )


def quaternion_fault(turns: Floats, has_heading: bool = True) -> tuple[int, str] | None:
    """The first of quaternions (n, 4: x, y, z, w) that turns nothing, or leaves no heading where
    there must be one: its row, and what is wrong with it.
    """
    # Clipped, since squares of large numbers overflow.
    lengths = np.linalg.norm(np.clip(turns, -2, 2), axis=1)
    unit = (lengths >= UNIT[0]) & (lengths <= UNIT[1])
    x, y, z, w = np.where(unit[:, None], turns, 0.0).T
    # The sine of the pitch is 2 (w y - x z) over the square of the quaternion's length.
    steep = np.abs(w * y - x * z) * 2 > np.sin(MOST_PITCH) * np.where(unit, lengths, 1.0) ** 2
    for wrong, reason in (
        (~unit, "a quaternion that is not of length 1"),
        (steep & has_heading, f"a pitch beyond {np.degrees(MOST_PITCH):.0f} degrees"),
    ):
        if wrong.any():
            return int(wrong.argmax()), reason
    return None
