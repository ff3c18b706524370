"""What happens to the ego while its world moves on from one keyframe to the next."""

import math
from collections.abc import Callable, Mapping

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.world.approach import ClosestApproach, Impact
from care_sim.world.bodies import BodyKind
from care_sim.world.body_tables import Footprints
from care_sim.world.bullet import BulletWorld
from care_sim.world.clearance_judge import CONTACT_REACH_M, ClearanceJudge, judge_here
from care_sim.world.gaps import PADDING_M, least_gap


class Passage:
    """How close the body `ego` comes to the body `target`, if there is one, and how it first hits
    any other. It looks after every world step: between two keyframes the car may hit something and
    be past it, or come closest to it.

    `footprints` and `bullet` say where all bodies are, `kinds` what they are, and `velocities_of`
    gives the (n, 2) velocities of bodies (n,).
    """

    def __init__(
        self,
        footprints: Footprints,
        bullet: BulletWorld,
        kinds: Mapping[int, BodyKind],
        ego: int,
        target: int | None,
        velocities_of: Callable[[Integers], Floats],
    ):
        self._footprints = footprints
        self._bullet = bullet
        self._kinds = kinds
        self._ego = ego
        self._velocities_of = velocities_of
        self._judge = judge_here()
        self._impact: Impact | None = None
        self._nearest_m = np.inf
        self._least: LeastClearance | None = None
        if target is not None:
            self._two = np.array([ego, target])
            self._least = LeastClearance(self._judge, kinds[ego], kinds[target])

    def look(self, speed_mps: float) -> None:
        """Look at the world after a step, which left the ego with a speed."""
        if self._impact is None:
            self._impact = self._contact(speed_mps)
        if self._least is not None:
            boxes = own, other = self._footprints.boxes[self._two]
            away = np.hypot(other[0] - own[0], other[1] - own[1])
            self._nearest_m = min(self._nearest_m, float(away))
            self._least.note(boxes, self._bullet.primitives.poses[self._two])

    def closest(self) -> ClosestApproach:
        """What came of it."""
        clearance_m = np.inf if self._least is None else self._least.metres()
        return ClosestApproach(self._nearest_m, clearance_m, self._impact)

    def _contact(self, speed_mps: float) -> Impact | None:
        """The ego's contact with a body now."""
        # The exact distance is PyBullet's; asking it about every body would take most of a step.
        own = self._kinds[self._ego]
        for body in self._footprints.near(self._ego, CONTACT_REACH_M).tolist():
            poses = self._bullet.primitives.poses[[self._ego, body]]
            kind = self._kinds[body]
            if self._judge.touch((own, kind), poses):
                (velocity,) = self._velocities_of(np.array([body]))
                boxes = self._footprints.boxes
                return Impact.on(body, kind.name, boxes, self._ego, speed_mps, velocity)
        return None


class LeastClearance:
    """Between the hulls of an `ego` and an `other` body of these kinds, at the moments that were
    noted. PyBullet's exact distance costs more than everything else that is scored in a step, so it
    is asked about few: while two bodies come nearer, about the last moment alone.
    """

    def __init__(self, judge: ClearanceJudge, ego: BodyKind, other: BodyKind):
        self._judge = judge
        self._kinds = ego, other
        self._moments: list[tuple[float, Floats]] = []

    def note(self, boxes: Floats, poses: Floats) -> None:
        """Note where the two are now: the boxes (2, 7) that hold them, and their poses (2, 7) as in
        `care_sim.world.body_tables.Primitives.poses`.
        """
        self._moments.append((least_gap(*boxes) - PADDING_M, poses))

    def metres(self) -> float:
        """The least clearance of all moments; negative when the hulls overlapped."""
        # First the moment at which they could be nearest. Whoever was farther apart than what is
        # found by then need not be asked about.
        least = math.inf
        for at_least, poses in sorted(self._moments, key=lambda moment: moment[0]):
            if at_least > least:
                break
            stand_ins = self._judge.stand_ins(*self._kinds)
            least = min(least, self._judge.clearance(stand_ins, poses))
        return least
