"""How far bodies of any world are apart, asked of one client of PyBullet for them all.

The parts of a body stand apart there: PyBullet measures every two parts of two bodies, and most of
them are too far apart to matter. It is asked about those that could be the nearest.
"""

import math
import threading
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.world.bodies import BodyKind
from care_sim.world.bullet_bodies import OPAQUE, BulletBodies
from care_sim.world.bullet_clients import LentClient, pybullet
from care_sim.world.gaps import PADDING_M, nearest_parts

CONTACT_REACH_M = 0.5
"""Contact is looked for among bodies this close: far more than the centimetres by which hulls are
padded.
"""
MOST_KINDS = 256
"""A judge that worlds share knows no more kinds of bodies: streets may have kinds of their own."""


class StandIn(NamedTuple):
    """What stands in for a body: a body for each of its n parts, and the boxes of these, (n, 6)
    centre and size in the frame of the body.
    """

    bodies: list[int]
    boxes: Floats


StandIns = tuple[StandIn, StandIn]
"""For an ego and another body."""


class ClearanceJudge:
    """The distances of `BulletWorld.clearance`, to the last bit, between an ego and another body,
    given by their kinds and poses.
    """

    def __init__(self) -> None:
        self._client = LentClient()
        self._bodies = BulletBodies(self._client, ground=False)
        self._egos: dict[BodyKind, StandIn] = {}
        self._others: dict[BodyKind, StandIn] = {}

    def stand_ins(self, ego: BodyKind, other: BodyKind) -> StandIns:
        """What stands in for an ego of one kind and another body of the other."""
        return self._known(self._egos, ego), self._known(self._others, other)

    def clearance(
        self,
        bodies: StandIns,
        poses: Floats | Sequence[Sequence[float]],
        within: float = 100.0,
    ) -> float:
        """Smallest distance between the hulls of two stand-ins at `poses` (2, 7), as in
        `Primitives.poses`, metres; negative when they overlap, inf beyond `within`.
        """
        ego, other = bodies
        places = np.asarray(poses, float)
        gaps, pairs = nearest_parts(ego.boxes, other.boxes, places)
        own, others = places.tolist()
        least = math.inf
        for gap, pair in zip(gaps.tolist(), pairs.tolist(), strict=True):
            if gap - PADDING_M > min(least, within):
                break
            part, there = divmod(pair, len(other.bodies))
            number = self._bodies.put(ego.bodies[part], own)
            other_number = self._bodies.put(other.bodies[there], others)
            least = min(least, self._bodies.clearance(number, other_number, within))
        return least

    def touch(self, kinds: tuple[BodyKind, BodyKind], poses: Floats) -> bool:
        """Whether the hulls of an ego and another body of these kinds touch at `poses` (2, 7), as
        in `Primitives.poses`.
        """
        return self.clearance(self.stand_ins(*kinds), poses, CONTACT_REACH_M) <= 0.0

    @property
    def serves_on(self) -> bool:
        """Whether it can be asked further: it knows few kinds, and nobody else has closed or
        emptied its client.
        """
        made = self._bodies.made
        if not made:
            return not self._client.closed
        client = self._client.number
        is_whole = pybullet.isConnected(client) and made == pybullet.getNumBodies(client)
        return is_whole and len(self._egos) + len(self._others) < MOST_KINDS

    def close(self) -> None:
        """Free the simulator."""
        self._client.close()

    def _known(self, known: dict[BodyKind, StandIn], kind: BodyKind) -> StandIn:
        if kind not in known:
            bodies = [self._bodies.add([part], (), OPAQUE) for part in kind.parts]
            boxes = np.array([(*part.centre, *part.size) for part in kind.parts], float)
            known[kind] = StandIn(bodies, boxes)
        return known[kind]


class _Shared(threading.local):
    judge: ClearanceJudge | None = None


_SHARED = _Shared()


def judge_here() -> ClearanceJudge:
    """The judge that the worlds of this thread share. It serves until the next call, and in this
    thread alone.
    """
    if _SHARED.judge is None or not _SHARED.judge.serves_on:
        _SHARED.judge = ClearanceJudge()
    return _SHARED.judge
