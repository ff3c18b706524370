"""UN Regulation 157: a slower vehicle changes over from the lane beside into the ego's.

The grid follows scenario 4.4_1 of the ALKS scenarios that BMW and ASAM published for the regulation
(github.com/asam-oss/OSC-ALKS-scenarios). That holds for ego speeds, relative speeds, lateral
speeds, kinds, sides, and the limits of their combinations. Gaps have half the step, 5 m instead of
10 m, and leave out 0.

Preventable cases: both vehicles are boxes along the road. The other vehicle moves at constant
speed, along and across. The ego keeps its speed until its driver brakes
(`care_sim.driving.drivers`), and then slows down to the other's speed. So their distance follows in
closed form, without time steps.
"""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import cycle, product

import numpy as np

from care_sim.base.checks import bounded, one_of
from care_sim.base.errors import InvalidInput
from care_sim.driving.drivers import HUMAN_MODEL
from care_sim.scenarios.base import LONGEST_EPISODE_S, Scenario
from care_sim.streets.layouts import Range, draw
from care_sim.world.bodies import CATALOGUE
from care_sim.world.motions import LaneChange
from care_sim.world.traffic import Traffic
from care_sim.world.world import World

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
"""Longest time to collision at the beginning of a lane change. The slowest change takes 3.3 s until
the car is in the way: longer approaches are as to any car ahead.
"""


@dataclass(frozen=True)
class CutInCase:
    """A vehicle that changes into the ego's lane ahead of it, at even speeds along and across."""

    ego_kph: float
    """V_e0, of the ego."""
    relative_kph: float
    """V_e0 - V_o0: the other's lag in speed."""
    gap_m: float
    """dx_0, from the ego's front to the other's rear when the other leaves the middle of its lane.
    """
    lateral_mps: float
    """V_y, of the other."""
    kind: str = "car"
    """Kind of the other vehicle: one of `KINDS`."""
    side: str = "right"
    """Side that it comes from: one of `SIDES`."""

    @property
    def length_m(self) -> float:
        """Return the length or width of the vehicle that cuts in."""
        return CATALOGUE[self.kind].size[0]

    @property
    def width_m(self) -> float:
        """Return the length or width of the vehicle that cuts in."""
        return CATALOGUE[self.kind].size[1]

    @property
    def other_mps(self) -> float:
        """Speed of the vehicle that cuts in, along the road."""
        return (self.ego_kph - self.relative_kph) * KPH

    @property
    def possible(self) -> bool:
        """True if the other is at least as fast as `SLOWEST_KPH`, faster along than across, and
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


HARMLESS = "harmless"
"""A car that never brakes is not touched: it has passed before the other is in its way."""
PREVENTABLE = "preventable"
"""A car that never brakes is touched, and the careful human is not."""
UNPREVENTABLE = "unpreventable"
_EGO_LENGTH_M, _EGO_WIDTH_M, _ = CATALOGUE["ego"].size


def verdicts(cases: Sequence[CutInCase]) -> list[str]:
    """Return `HARMLESS`, `PREVENTABLE` or `UNPREVENTABLE` for every case."""
    human = HUMAN_MODEL
    gap = np.array([case.gap_m for case in cases])
    closing = np.array([case.relative_kph * KPH for case in cases])
    lateral = np.array([case.lateral_mps for case in cases])
    length = np.array([case.length_m for case in cases])
    width = np.array([case.width_m for case in cases])

    # Without braking: where is the ego when the sides of both meet?
    meeting_s = (human.lane_m - (_EGO_WIDTH_M + width) / 2) / lateral
    passed = gap - closing * meeting_s <= -(_EGO_LENGTH_M + length)

    # The gap is least when the ego has come down to the other's speed, and then it stays. An ego
    # that would not have passed is touched as soon as it is beside the other, before or after that.
    danger_s = human.wander_m / lateral + human.evaluation_s
    danger_s = np.maximum(danger_s, gap / closing - human.danger_s)
    braking_s = human.time_to_lose(closing)
    least = gap - closing * (danger_s + braking_s) + human.distance_saved(braking_s)
    words = np.where(passed, HARMLESS, np.where(least > 0, PREVENTABLE, UNPREVENTABLE))
    return [str(word) for word in words]


def preventable(cases: Sequence[CutInCase]) -> list[CutInCase]:
    """Return the preventable cases, which are scored."""
    marked = zip(cases, verdicts(cases), strict=True)
    return [case for case, verdict in marked if verdict == PREVENTABLE]


_ROAD_LIMIT_MPS = 130 * KPH
"""The lanes must have a limit; nobody on this road drives by it."""


@dataclass(frozen=True)
class R157(Scenario):
    """A slower vehicle changes over from the next lane into the ego's (UN Regulation 157).

    The ego drives in the middle one of three lanes, and nobody else is on the road. The seed draws
    every value that is None: kind and side first, then a preventable case of the grid with the
    given values (`care_sim.scenarios.r157`). If none is preventable, it draws from all cases.
    """

    duration_s: float = bounded(10.0, 0.05, LONGEST_EPISODE_S)
    ego_kph: float | None = bounded(None, 10.1, 130)
    """Speed of the ego, km/h."""
    relative_kph: float | None = bounded(None, 0.1, 120)
    """Speed of the ego minus speed of the other vehicle, km/h."""
    gap_m: float | None = bounded(None, 0.1, 200)
    """Gap from bumper to bumper when the lane change begins, if nobody brakes."""
    lateral_mps: float | None = bounded(None, 0.1, 5)
    """Lateral speed of the other vehicle, m/s."""
    kind: str | None = one_of(None, KINDS)
    """Kind of the other vehicle."""
    side: str | None = one_of(None, SIDES)
    """Side from which it comes."""
    lead_s: Range = bounded((1.0, 1.5), 0, 30)
    """Time before the lane change, in which tracks settle. The regulation leaves it open."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self._cases(KINDS[0], SIDES[0]):
            raise InvalidInput(
                "no cut-in of r157 has these speeds and this gap: the other must drive at least "
                f"{SLOWEST_KPH:g} km/h, faster along than across, and be reached in {LONGEST_S:g} s"
            )

    def build(self, rng: np.random.Generator) -> World:
        """A fresh world at time zero."""
        # The order of the draws is part of what a seed means.
        case = self.draw_case(rng)
        lead_s = draw(rng, self.lead_s)
        lane_m = HUMAN_MODEL.lane_m
        traffic = Traffic((1, 1, 1), 1, lane_m, _ROAD_LIMIT_MPS)
        ego_mps = case.ego_kph * KPH
        world = World(traffic, ego_mps)

        # The gap is between the bumpers at the begin of the lane change.
        apart = case.gap_m + (world.ego_kind.size[0] + case.length_m) / 2
        start_x = apart + (ego_mps - case.other_mps) * lead_s
        start = (start_x, lane_m if case.side == "left" else -lane_m)
        change = LaneChange(start, case.other_mps, lead_s, case.lateral_mps, to_y=0.0)
        world.first_sighting = world.add(case.kind, case.kind, change.pose)
        world.drawn = {
            name: value for name, value in asdict(case).items() if getattr(self, name) is None
        }
        return world

    def draw_case(self, rng: np.random.Generator) -> CutInCase:
        """The case of an episode."""
        kind = self.kind or KINDS[rng.integers(len(KINDS))]
        side = self.side or SIDES[rng.integers(len(SIDES))]
        possible = self._cases(kind, side)
        scored = preventable(possible) or possible
        return scored[rng.integers(len(scored))]

    def _cases(self, kind: str, side: str) -> list[CutInCase]:
        return cases(
            EGO_KPH if self.ego_kph is None else [self.ego_kph],
            RELATIVE_KPH if self.relative_kph is None else [self.relative_kph],
            GAP_M if self.gap_m is None else [self.gap_m],
            LATERAL_MPS if self.lateral_mps is None else [self.lateral_mps],
            kind,
            side,
        )
