"""Whether rectangles on the ground come close to each other, now or on their ways, compiled."""

import math

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Mask

Footprint = tuple[float, float]
"""Length and width in metres."""


def footprints_meet(
    poses: Floats, size: Floats, others: Floats, other_sizes: Floats, gap: Floats
) -> Mask:
    """(n,) whether rectangles come closer than `gap` (n,) along every axis (separating axis
    theorem).

    `poses` (n, 3) and `others` (n, 3) are x, y, heading; `size` and `other_sizes` (n, 2) length and
    width.
    """
    # One layout of the arrays, so that compiled code is compiled once.
    tables = (
        np.ascontiguousarray(each, dtype=float) for each in (poses, size, others, other_sizes, gap)
    )
    return np.asarray(_each_meets(*tables))


@compiled()
def _each_meets(
    poses: Floats, sizes: Floats, others: Floats, other_sizes: Floats, gaps: Floats
) -> Mask:
    """See `footprints_meet`."""
    meet = np.empty(len(poses), np.bool_)
    for n in range(len(poses)):
        meet[n] = _rectangles_meet(poses[n], sizes[n], others[n], other_sizes[n], gaps[n])
    return meet


@compiled()
def meets_any(
    way: Floats, size: Footprint, ways: Floats, bounds: Floats, sizes: Floats, berths: Floats
) -> bool:
    """Whether a footprint on `way` (1 or t, 3) ever comes closer than its berth to one of others,
    along every axis.

    These are on `ways` (n, 1 or t, 3), within `bounds` (n, 4) as `way_bounds` gives them; they have
    `sizes` (n, 2) and `berths` (n,). A way of one pose is that of what stands.
    """
    left, low, right, high = way_bounds(way)
    times = max(len(way), ways.shape[1])
    for n in range(len(ways)):
        # First by what holds the whole ways, then by centres: that leaves few pairs for the exact
        # test. Rectangles that touch have centres no farther apart than half of both diagonals. The
        # exact test moves every side out by the berth, and a corner then moves by sqrt(2) berths at
        # most, at a right angle.
        diagonals = math.hypot(sizes[n, 0], sizes[n, 1]) + math.hypot(size[0], size[1])
        reach = diagonals / 2 + math.sqrt(2) * berths[n]
        across = max(bounds[n, 0] - right, left - bounds[n, 2])
        along = max(bounds[n, 1] - high, low - bounds[n, 3])
        if max(across, along) >= reach:
            continue
        for time in range(times):
            mine, theirs = min(time, len(way) - 1), min(time, ways.shape[1] - 1)
            x, y = ways[n, theirs, 0] - way[mine, 0], ways[n, theirs, 1] - way[mine, 1]
            if x * x + y * y < reach * reach and _rectangles_meet(
                way[mine], size, ways[n, theirs], sizes[n], berths[n]
            ):
                return True
    return False


@compiled()
def way_bounds(way: Floats) -> tuple[float, float, float, float]:
    """Least x and y, then greatest x and y, of the centres on a way (t, 3)."""
    left, low, right, high = math.inf, math.inf, -math.inf, -math.inf
    for x, y, _ in way:
        left, low = min(left, x), min(low, y)
        right, high = max(right, x), max(high, y)
    return left, low, right, high


@compiled()
def _rectangles_meet(
    pose: Floats, size: Floats | Footprint, other: Floats, other_size: Floats, gap: float
) -> bool:
    """Whether two rectangles come closer than `gap` along every axis."""
    # They are apart if they are so along the direction of some side of either.
    for angle in (pose[2], pose[2] + math.pi / 2, other[2], other[2] + math.pi / 2):
        apart = (other[0] - pose[0]) * math.cos(angle) + (other[1] - pose[1]) * math.sin(angle)
        reaches = _reach(pose[2], size, angle) + _reach(other[2], other_size, angle)
        if abs(apart) >= reaches + gap:
            return False
    return True


@compiled()
def _reach(heading: float, size: Floats | Footprint, angle: float) -> float:
    """Half the extent of a rectangle along the direction `angle`."""
    turn = angle - heading
    extent: float = abs(math.cos(turn)) * size[0] + abs(math.sin(turn)) * size[1]
    return extent / 2
