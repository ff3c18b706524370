"""Contact and clearance of the ego between keyframes."""

import math
import threading
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers
from care_sim.world.bodies import BodyKind
from care_sim.world.bullet_bodies import LentClient, make_collision_shape, pybullet

PADDING_M = 0.05
"""PyBullet's distances may be this much less than those of the exact hulls; 2 mm were seen."""


@compiled()
def least_gap(box: Floats, other: Floats) -> float:
    """Return a lower bound of the distance of two boxes (7,) on the ground, metres; -inf where they
    may overlap.
    """
    # In the plane, and in the axes of the first: there an upright rectangle holds the other.
    dx, dy, turned = other[0] - box[0], other[1] - box[1], other[6] - box[6]
    cos, sin = math.cos(box[6]), math.sin(box[6])
    ahead, aside = cos * dx + sin * dy, cos * dy - sin * dx
    cos, sin = abs(math.cos(turned)), abs(math.sin(turned))
    along = abs(ahead) - (box[3] + other[3] * cos + other[4] * sin) / 2
    across = abs(aside) - (box[4] + other[3] * sin + other[4] * cos) / 2
    if along <= 0 and across <= 0:
        return -math.inf
    return math.hypot(max(along, 0.0), max(across, 0.0))


@compiled(brief=True)
def nearest_parts(own: Floats, other: Floats, poses: Floats) -> tuple[Floats, Integers]:
    """Return lower bounds of the distances between the parts of two bodies at some moments,
    (t * n * m,) metres, ascending, and their pairs. Pair (k * n + i) * m + j is part i of n and
    part j of m at moment k of t. The bound is -inf where parts may overlap.

    The boxes of parts are (n, 6) and (m, 6): centre and size in the frame of their body. The bodies
    stand at `poses` (t, 2, 7) as in `care_sim.world.body_tables.Primitives.poses`.
    """
    gaps = np.empty(len(poses) * len(own) * len(other))
    count = 0
    for pair in poses:
        boxes, others = _standing_parts(own, pair[0]), _standing_parts(other, pair[1])
        # A body that does not stand upright is in no such box.
        tilted = pair[0, 3] != 0 or pair[0, 4] != 0 or pair[1, 3] != 0 or pair[1, 4] != 0
        for box in boxes:
            for there in others:
                aside = max(least_gap(box, there), 0.0)
                above = max(abs(box[2] - there[2]) - (box[5] + there[5]) / 2, 0.0)
                apart = math.hypot(aside, above)
                gaps[count] = apart if apart > 0 and not tilted else -math.inf
                count += 1
    order = np.argsort(gaps)
    return gaps[order], order


@compiled()
def _standing_parts(parts: Floats, pose: Floats) -> Floats:
    """(n, 7) the boxes of the parts (n, 6) of an upright body, in the world frame."""
    boxes = np.empty((len(parts), 7))
    yaw = 2 * math.atan2(pose[5], pose[6])
    cos, sin = math.cos(yaw), math.sin(yaw)
    for n in range(len(boxes)):
        x, y = parts[n, 0], parts[n, 1]
        boxes[n, 0] = pose[0] + cos * x - sin * y
        boxes[n, 1] = pose[1] + sin * x + cos * y
        boxes[n, 2] = pose[2] + parts[n, 2]
        boxes[n, 3:6] = parts[n, 3:6]
        boxes[n, 6] = yaw
    return boxes


CONTACT_REACH_M = 0.5
"""Contact is looked for among bodies this close: far more than the centimetres by which hulls are
padded.
"""
MOST_KINDS = 256
"""Most kinds of bodies in a shared judge, since streets may have kinds of their own."""


class StandIn(NamedTuple):
    """Stand-ins of a body: its n parts as PyBullet's numbers of their shapes, and as boxes (n, 6),
    centre and size in the frame of the body.
    """

    shapes: list[int]
    boxes: Floats


StandIns = tuple[StandIn, StandIn]
"""For an ego and another body."""


def boxes_of(kind: BodyKind) -> Floats:
    """Return the parts of a kind as boxes (n, 6); see `StandIn`."""
    return np.array([(*part.centre, *part.size) for part in kind.parts], float)


class ClearanceJudge:
    """Computes the clearance between an ego and another body, given by kinds and poses, with one
    PyBullet client for all worlds. Bit-identical to `BulletWorld.clearance`.

    Each part is a shape of its own in the client. PyBullet measures every pair of parts of two
    bodies, and most pairs are too far apart to matter. So only pairs that could be the nearest are
    measured.
    """

    def __init__(self) -> None:
        self._client = LentClient()
        self._known: dict[BodyKind, StandIn] = {}
        # This body is missing once other code has emptied the client.
        pybullet.createMultiBody(physicsClientId=self._client.number)

    def stand_ins(self, ego: BodyKind, other: BodyKind) -> StandIns:
        """Return the stand-ins of an ego of one kind and of another body."""
        return self._stand_in(ego), self._stand_in(other)

    def clearance(self, bodies: StandIns, poses: Floats, within: float = 100.0) -> float:
        """Return the smallest distance between the hulls of two stand-ins at the `poses` (t, 2, 7)
        of some moments, as in `Primitives.poses`, metres. Negative if they overlap, inf beyond
        `within`.
        """
        gaps, pairs = nearest_parts(bodies[0].boxes, bodies[1].boxes, poses)
        return self.least(bodies, poses, gaps.tolist(), pairs.tolist(), within)

    def least(
        self,
        bodies: StandIns,
        poses: Floats,
        gaps: Sequence[float],
        pairs: Sequence[int],
        within: float = 100.0,
    ) -> float:
        """As `clearance`, given the bounds and pairs of `nearest_parts`."""
        (shapes, _), (others, _) = bodies
        least = math.inf
        for gap, pair in zip(gaps, pairs, strict=True):
            if gap - PADDING_M > min(least, within):
                break
            moment, parts = divmod(pair, len(shapes) * len(others))
            part, there = divmod(parts, len(others))
            own, other = poses[moment].tolist()
            # Bodies and links, of which there are none, then place and turn of each shape.
            for point in pybullet.getClosestPoints(
                *(-1, -1, within, -1, -1, shapes[part], others[there]),
                *(own[:3], other[:3], own[3:], other[3:], self._client.number),
            ):
                least = min(least, point[8])
        return least

    def touch(self, kinds: tuple[BodyKind, BodyKind], poses: Floats) -> bool:
        """Return True if the hulls of an ego and another body of these kinds touch at `poses` (2,
        7), as in `Primitives.poses`.
        """
        return self.clearance(self.stand_ins(*kinds), poses[None], CONTACT_REACH_M) <= 0.0

    @property
    def is_usable(self) -> bool:
        """Return True while the judge holds few kinds and no other code has closed or emptied its
        client.
        """
        client = self._client.number
        is_whole = pybullet.isConnected(client) and pybullet.getNumBodies(client) == 1
        return is_whole and len(self._known) < MOST_KINDS

    def close(self) -> None:
        """Free the simulator."""
        self._client.close()

    def _stand_in(self, kind: BodyKind) -> StandIn:
        if kind not in self._known:
            shapes = [make_collision_shape([part], self._client.number) for part in kind.parts]
            self._known[kind] = StandIn(shapes, boxes_of(kind))
        return self._known[kind]


class _Shared(threading.local):
    judge: ClearanceJudge | None = None


_SHARED = _Shared()


def borrow_judge() -> ClearanceJudge:
    """Return the judge that the worlds of this thread share. Use it until the next call, and in
    this thread only.
    """
    if _SHARED.judge is None or not _SHARED.judge.is_usable:
        _SHARED.judge = ClearanceJudge()
    return _SHARED.judge
