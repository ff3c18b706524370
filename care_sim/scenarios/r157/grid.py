"""The grid of cut-ins: what can vary, and in which steps.

Ego speeds, relative speeds, lateral speeds, kinds and sides, and the limits to their combinations,
are those of scenario 4.4_1 of the ALKS scenarios that BMW and ASAM published for the regulation
(github.com/asam-oss/OSC-ALKS-scenarios). Gaps have half their step, 5 m for 10 m, and leave out 0.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import cycle, product

from care_sim.world.bodies import CATALOGUE

KPH = 1 / 3.6
"""A kilometre per hour in m/s."""
EGO_KPH = (20.0, 30.0, 40.0, 50.0, 60.0)
RELATIVE_KPH = (10.0, 20.0, 30.0, 40.0, 50.0)
GAP_STEP_M = 5.0
GAP_M = tuple(n * GAP_STEP_M for n in range(1, 13))
LATERAL_MPS = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0)
KINDS = ("car", "truck", "van", "bus", "motorcycle")
SIDES = ("left", "right")
SLOWEST_KPH = 10.0
"""The least speed of the vehicle that cuts in."""
LONGEST_S = 6.0
"""The longest time to collision at the begin of a lane change. The slowest one takes 3.3 s until a
car is in the way: longer approaches end as any to a car ahead.
"""


@dataclass(frozen=True)
class CutInCase:
    """A vehicle that changes into the ego's lane ahead of it, at even speeds along and across."""

    ego_kph: float
    """V_e0, of the ego."""
    relative_kph: float
    """V_e0 - V_o0: by how much the other is slower."""
    gap_m: float
    """dx_0, from the ego's front to the other's rear when the other leaves the middle of its lane.
    """
    lateral_mps: float
    """V_y, of the other."""
    kind: str = "car"
    """What it is: one of `KINDS`."""
    side: str = "right"
    """Where it comes from: one of `SIDES`."""

    @property
    def length_m(self) -> float:
        """Of the vehicle that cuts in."""
        return CATALOGUE[self.kind].size[0]

    @property
    def width_m(self) -> float:
        """Of the vehicle that cuts in."""
        return CATALOGUE[self.kind].size[1]

    @property
    def other_mps(self) -> float:
        """Speed of the vehicle that cuts in, along the road."""
        return (self.ego_kph - self.relative_kph) * KPH

    @property
    def possible(self) -> bool:
        """Whether the other is no slower than `SLOWEST_KPH`, faster along than across, and would be
        reached within `LONGEST_S`.
        """
        return (
            self.other_mps >= SLOWEST_KPH * KPH
            and self.lateral_mps < self.other_mps
            and self.gap_m <= self.relative_kph * KPH * LONGEST_S
        )


def cases(
    ego_kph: Iterable[float] = EGO_KPH,
    relative_kph: Iterable[float] = RELATIVE_KPH,
    gap_m: Iterable[float] = GAP_M,
    lateral_mps: Iterable[float] = LATERAL_MPS,
    kind: str = KINDS[0],
    side: str = SIDES[0],
) -> list[CutInCase]:
    """The possible cases of one kind and side; by default all of their grid."""
    axes = (ego_kph, relative_kph, gap_m, lateral_mps)
    made = (CutInCase(*values, kind, side) for values in product(*axes))
    return [case for case in made if case.possible]


def kinds_in_turn() -> list[CutInCase]:
    """The grid with every combination of speeds and gap once: the kinds take turns, and so do the
    sides.
    """
    turns = cycle(product(SIDES, KINDS))
    return [
        replace(case, kind=kind, side=side)
        for case, (side, kind) in zip(cases(), turns, strict=False)
    ]
