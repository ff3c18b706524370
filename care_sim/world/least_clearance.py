"""The least clearance of two bodies over some moments, of which PyBullet is asked about few.

Its exact distance costs more than everything else that is scored in a step. While two bodies come
nearer it is needed of the last moment alone.
"""

import math

from care_sim.core.arrays import Floats
from care_sim.world.bodies import BodyKind
from care_sim.world.clearance_judge import ClearanceJudge
from care_sim.world.gaps import PADDING_M, least_gap


class LeastClearance:
    """Between the hulls of an `ego` and an `other` body of these kinds, at the moments that were
    noted.
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
