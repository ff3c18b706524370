"""How far bodies of any world are apart, asked of one client of PyBullet for them all."""

import threading
from collections.abc import Sequence

from care_sim.core.arrays import Floats
from care_sim.world.bodies import BodyKind
from care_sim.world.bullet_bodies import OPAQUE, BulletBodies
from care_sim.world.bullet_clients import LentClient, pybullet

CONTACT_REACH_M = 0.5
"""Contact is looked for among bodies this close: far more than the centimetres by which hulls are
padded.
"""
MOST_KINDS = 256
"""A judge that worlds share knows no more kinds of bodies: streets may have kinds of their own."""


class ClearanceJudge:
    """The distances of `BulletWorld.clearance`, to the last bit, between an ego and another body,
    given by their kinds and poses. A body of either kind stands in for that of the world.
    """

    def __init__(self) -> None:
        self._client = LentClient()
        self._bodies = BulletBodies(self._client, ground=False)
        self._egos: dict[BodyKind, int] = {}
        self._others: dict[BodyKind, int] = {}

    def stand_ins(self, ego: BodyKind, other: BodyKind) -> tuple[int, int]:
        """The bodies that stand in for an ego of one kind and another body of the other."""
        return self._known(self._egos, ego), self._known(self._others, other)

    def clearance(
        self, bodies: tuple[int, int], poses: Sequence[Sequence[float]], within: float = 100.0
    ) -> float:
        """Smallest distance between the hulls of two stand-ins at `poses`, of each its seven
        numbers as in `Primitives.poses`, metres; negative when they overlap, inf beyond `within`.
        """
        ego, other = map(self._bodies.put, bodies, poses)
        return self._bodies.clearance(ego, other, within)

    def touch(self, kinds: tuple[BodyKind, BodyKind], poses: Floats) -> bool:
        """Whether the hulls of an ego and another body of these kinds touch at `poses` (2, 7), as
        in `Primitives.poses`.
        """
        return self.clearance(self.stand_ins(*kinds), poses.tolist(), CONTACT_REACH_M) <= 0.0

    @property
    def serves_on(self) -> bool:
        """Whether it can be asked further: it knows few kinds, and nobody else has closed or
        emptied its client.
        """
        made = self._bodies.made
        if not made:
            return True
        client = self._client.number
        is_whole = pybullet.isConnected(client) and made == pybullet.getNumBodies(client)
        return is_whole and len(self._egos) + len(self._others) < MOST_KINDS

    def close(self) -> None:
        """Free the simulator."""
        self._client.close()

    def _known(self, bodies: dict[BodyKind, int], kind: BodyKind) -> int:
        if kind not in bodies:
            bodies[kind] = self._bodies.add(kind.parts, (), OPAQUE)
        return bodies[kind]


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
