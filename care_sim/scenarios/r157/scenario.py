"""UN Regulation 157: a slower vehicle changes over from the lane beside into the ego's."""

from dataclasses import asdict, dataclass

import numpy as np

from care_sim.base.checks import bounded, one_of
from care_sim.base.errors import InvalidInput
from care_sim.driving.drivers import HUMAN_MODEL
from care_sim.scenarios.base import LONGEST_EPISODE_S, Scenario
from care_sim.scenarios.r157.grid import (
    EGO_KPH,
    GAP_M,
    KINDS,
    KPH,
    LATERAL_MPS,
    LONGEST_S,
    RELATIVE_KPH,
    SIDES,
    SLOWEST_KPH,
    CutInCase,
    cases,
)
from care_sim.scenarios.r157.preventable import preventable
from care_sim.streets.dimensions import Range, draw
from care_sim.world.motions import LaneChange
from care_sim.world.traffic import Traffic
from care_sim.world.world import World

_ROAD_LIMIT_MPS = 130 * KPH
"""The lanes must have a limit; nobody on this road drives by it."""


@dataclass(frozen=True)
class R157(Scenario):
    """Three lanes, the ego in the middle one. A slower vehicle in the lane beside changes over into
    it. Nothing hides it, and nobody else is on the road, as in the regulation.

    What is None is drawn by the seed: kind and side first, then among the preventable cases of the
    grid (`care_sim.scenarios.r157.grid`) that have the values that are given; among all of them
    where none is preventable. What may be given is beyond the grid on both sides.
    """

    duration_s: float = bounded(10.0, 0.05, LONGEST_EPISODE_S)
    ego_kph: float | None = bounded(None, 10.1, 130)
    """Speed of the ego, km/h."""
    relative_kph: float | None = bounded(None, 0.1, 120)
    """By how much the other is slower, km/h."""
    gap_m: float | None = bounded(None, 0.1, 200)
    """From the ego's front to the other's rear when the lane change begins, if nobody brakes."""
    lateral_mps: float | None = bounded(None, 0.1, 5)
    """Lateral speed of the other, m/s."""
    kind: str | None = one_of(None, KINDS)
    """What the other is."""
    side: str | None = one_of(None, SIDES)
    """Where it comes from."""
    lead_s: Range = bounded((1.0, 1.5), 0, 30)
    """Time before the lane change, in which tracks settle; the regulation leaves it open."""

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
