"""How far bodies of any world are apart, asked of one client of PyBullet for them all."""

from care_sim.core.arrays import Floats
from care_sim.world.bodies import BodyKind
from care_sim.world.bullet import BulletWorld


class ClearanceJudge:
    """The distances of `BulletWorld.clearance`, to the last bit, between an ego and another body,
    given by their kinds and poses. A body of either kind stands in for that of the world.
    """

    def __init__(self) -> None:
        self._bullet = BulletWorld(ground=False)
        self._egos: dict[BodyKind, int] = {}
        self._others: dict[BodyKind, int] = {}

    def stand_ins(self, ego: BodyKind, other: BodyKind) -> tuple[int, int]:
        """The bodies that stand in for an ego of one kind and another body of the other."""
        return self._known(self._egos, ego), self._known(self._others, other)

    def clearance(self, bodies: tuple[int, int], poses: Floats, within: float = 100.0) -> float:
        """Smallest distance between the hulls of two stand-ins at `poses` (2, 7) as in
        `Primitives.poses`, metres; negative when they overlap, inf beyond `within`.
        """
        self._bullet.put(bodies, poses)
        return self._bullet.clearance(*bodies, within)

    def close(self) -> None:
        """Free the simulator."""
        self._bullet.close()

    def _known(self, bodies: dict[BodyKind, int], kind: BodyKind) -> int:
        if kind not in bodies:
            bodies[kind] = self._bullet.add(kind, (0.0, 0.0, 0.0))
        return bodies[kind]
