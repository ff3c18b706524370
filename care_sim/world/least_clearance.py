"""The least clearance of two bodies over some moments, of which PyBullet is asked about few.

Its exact distance costs more than everything else that is scored in a step. While two bodies come
nearer it is needed of the last moment alone.
"""

import math

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats
from care_sim.world.bodies import BodyKind
from care_sim.world.clearance_judge import ClearanceJudge

PADDING_M = 0.05
"""PyBullet's distances may be this much less than those of the exact hulls; 2 mm were seen."""


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
            least = min(least, self._judge.clearance(stand_ins, poses.tolist()))
        return least


@compiled()
def least_gap(box: Floats, other: Floats) -> float:
    """What two boxes (7,) on the ground are apart at least, metres; -inf where they may overlap."""
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
