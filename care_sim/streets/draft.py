"""A street in progress: standing and moving bodies, and tests of free room."""

import math

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Mask, longer
from care_sim.world.bodies import CATALOGUE

Footprint = tuple[float, float]
"""Length and width in metres."""


def footprints_meet(
    poses: Floats, size: Floats, others: Floats, other_sizes: Floats, gap: Floats
) -> Mask:
    """Return (n,) whether rectangles come closer than `gap` (n,) along every axis (separating axis
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
def meets_any(way: Floats, size: Footprint, ways: Floats, others: Floats) -> bool:
    """Return True if a footprint on `way` (1 or t, 3) ever comes closer than its berth to others,
    along every axis.

    The `others` (n, 7) are on `ways` (n, 1 or t, 3): bounds of `way_bounds`, sizes and berths.
    Standing bodies have a way of one pose.
    """
    left, low, right, high = way_bounds(way)
    times = max(len(way), ways.shape[1])
    for n in range(len(ways)):
        # First by bounds of whole ways, then by centres, which leaves few pairs for the exact test.
        # Rectangles that touch have centres no farther apart than half of both diagonals. The exact
        # test moves every side out by the berth, and a corner then moves by sqrt(2) berths at most,
        # at a right angle.
        bounds, other, berth = others[n, :4], others[n, 4:6], others[n, 6]
        diagonals = math.hypot(other[0], other[1]) + math.hypot(size[0], size[1])
        reach = diagonals / 2 + math.sqrt(2) * berth
        across = max(bounds[0] - right, left - bounds[2])
        along = max(bounds[1] - high, low - bounds[3])
        if max(across, along) >= reach:
            continue
        for time in range(times):
            mine, theirs = min(time, len(way) - 1), min(time, ways.shape[1] - 1)
            x, y = ways[n, theirs, 0] - way[mine, 0], ways[n, theirs, 1] - way[mine, 1]
            if x * x + y * y < reach * reach and _rectangles_meet(
                way[mine], size, ways[n, theirs], other, berth
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


STEP_S = 0.1
"""Seconds between samples of a way. A car at 30 km/h moves 0.8 m meanwhile, so nobody can step
through a car between samples.
"""
STREET_KEYFRAME_S = 0.5
KEYFRAMES = 40
"""20 s at 2 Hz, as the scenes of nuScenes (paper, Sec. 5.1)."""
TIMES: Floats = STEP_S * np.arange(round(KEYFRAMES * STREET_KEYFRAME_S / STEP_S), dtype=np.float64)
"""(t,) seconds at which ways are sampled."""


class PlacedBodies:
    """Footprints with their ways, a row each in tables that grow. A way is (1, 3) for standing
    bodies, else (t, 3); all have one length.
    """

    def __init__(self) -> None:
        self._count = 0
        self._ways: Floats = np.empty((0, 1, 3))
        # Bounds, sizes and berths.
        self._rows: Floats = np.empty((0, 7))

    def add(self, way: Floats, size: Footprint, berth: float) -> None:
        """Add a footprint, which others pass at `berth` metres or more."""
        if self._count == len(self._rows):
            room = 2 * self._count + 8
            self._ways = longer(self._ways.reshape(1, -1, *way.shape), room)[0]
            self._rows = longer(self._rows[None], room)[0]
        self._ways[self._count] = way
        self._rows[self._count] = *way_bounds(way), *size, berth
        self._count += 1

    def meets(self, way: Floats, size: Footprint) -> bool:
        """Whether a footprint on `way` (1, 3) or (t, 3) ever comes closer to one of these than its
        berth, along every axis.
        """
        return bool(meets_any(way, size, self._ways[: self._count], self._rows[: self._count]))


TOUCH_M = 0.01
"""Smallest gap of standing bodies."""
SQUEEZE_M = 0.15
"""Least room of a walker on each side of a gap between standing bodies: a hand's breadth."""


class Draft:
    """Bodies by kind with their ways, the ground that must stay free, and the generator that draws
    them. Ways are sampled at `times` (t,), seconds.
    """

    def __init__(self, rng: np.random.Generator, times: Floats = TIMES) -> None:
        self.rng = rng
        self.times = times
        self.kinds: list[str] = []
        self.ways: list[Floats] = []
        self._fixed = PlacedBodies()
        self._moving = PlacedBodies()
        self._reserved = PlacedBodies()

    def reserve(self, pose: Floats, size: Footprint) -> None:
        """Keep a rectangle free of standing bodies: a carriageway, a junction."""
        self._reserved.add(pose.reshape(1, 3), size, 0.0)

    def obstruct(self, way: Floats, size: Footprint, berth: float) -> None:
        """Keep walkers off a way (t, 3) that no body of the draft uses: the ego's."""
        self._moving.add(way, size, berth)

    def has_room(self, pose: Floats, size: Footprint) -> bool:
        """Return True if a rectangle at a pose (3,) is always free."""
        way = pose.reshape(1, 3)
        kept = self._reserved, self._fixed, self._moving
        return not any(bodies.meets(way, size) for bodies in kept)

    def is_ground(self, pose: Floats, size: Footprint) -> bool:
        """Return True if no part of a rectangle at a pose (3,) is reserved, so that a kerb may be
        there.
        """
        return not self._reserved.meets(pose.reshape(1, 3), size)

    def is_way(self, pose: Floats, size: Footprint) -> bool:
        """Return True if a rectangle at a pose (3,) is reserved or anybody ever passes through
        it.
        """
        way = pose.reshape(1, 3)
        return self._reserved.meets(way, size) or self._moving.meets(way, size)

    def occupy(self, pose: Floats, size: Footprint) -> bool:
        """Take a rectangle at a pose (3,) for a standing body. Returns False if there is no
        room.
        """
        if not self.has_room(pose, size):
            return False
        self._fixed.add(pose.reshape(1, 3), size, TOUCH_M)
        return True

    def stand(self, kind: str, pose: Floats) -> bool:
        """Put a body at a pose (3,). Returns False if there is no room."""
        if not self.occupy(pose, _footprint(kind)):
            return False
        self._keep(kind, np.repeat(pose.reshape(1, 3), len(self.times), axis=0))
        return True

    def move(self, kind: str, way: Floats, berth: float) -> bool:
        """Let a body follow a way (t, 3). Returns False if the way is not always free."""
        size = _footprint(kind)
        # Standing bodies must leave room on both sides. Moving bodies have their own berth.
        if self._fixed.meets(
            way, (size[0] + 2 * SQUEEZE_M, size[1] + 2 * SQUEEZE_M)
        ) or self._moving.meets(way, size):
            return False
        self.drive(kind, way, berth)
        return True

    def drive(self, kind: str, way: Floats, berth: float) -> None:
        """Let a body follow a way (t, 3) that is known to be free: traffic avoids itself."""
        self._moving.add(way, _footprint(kind), berth)
        self._keep(kind, way)

    def _keep(self, kind: str, way: Floats) -> None:
        self.kinds.append(kind)
        self.ways.append(way)


def _footprint(kind: str) -> Footprint:
    length, width, _ = CATALOGUE[kind].size
    return length, width
