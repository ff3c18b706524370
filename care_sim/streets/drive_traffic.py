"""Who drives in a drive: the lanes of its roads and their vehicles at the start."""

from dataclasses import dataclass, replace

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.streets.curve import Curve
from care_sim.streets.dimensions import LANE_WIDTH_M, Range, draw
from care_sim.streets.drivers import (
    BEYOND_M,
    DRIVER_MPS,
    LEAD_M,
    SIDE_FLOW_PER_H,
    flow_places,
    traffic_kind,
)
from care_sim.streets.layouts import EVEN_CHANCE, Joining, Plan
from care_sim.world.bodies import CATALOGUE
from care_sim.world.lane_flow import STANDING_GAP_M

FLOW_PER_H: Range = SIDE_FLOW_PER_H
"""Drives go through residential streets: the flow of the streets' side streets on every road."""

SLOW_LEAD_M: Range = (22.0, 27.0)
SLOW_LEAD_MPS: Range = (5.6, DRIVER_MPS[0])
"""Somebody who looks for a place to park, at 20 to 25 km/h, starts as far ahead as IDM drivers keep
at that speed, or a little more; nobody else starts that near.
"""


@dataclass(frozen=True)
class DrivenLane:
    """A lane at `d` metres left of its road's line, led along it (`direction` +1) or against it.

    `places` (n,) are metres the way its vehicles drive, s or -s, ascending; `speeds` are m/s.
    `stop_m` is where the first gives way, inf where nobody need.
    """

    curve: Curve
    d: float
    direction: int
    kinds: tuple[str, ...]
    places: tuple[float, ...]
    speeds: tuple[float, ...]
    stop_m: float = np.inf

    def poses_at(self, places: Floats) -> Floats:
        """(n, 3) world poses of places (n,)."""
        road = np.empty((len(places), 3))
        road[:, 0] = self.direction * places
        road[:, 1] = self.d
        road[:, 2] = 0.0 if self.direction > 0 else np.pi
        return self.curve.to_world(road)


def drive_own_lane(rng: np.random.Generator, plan: Plan, reach_m: float) -> DrivenLane:
    """The ego's lane, which it drives for `reach_m`: who drives ahead of it, and behind. In half of
    the drives the one ahead is near, and slow.
    """
    slow_lead = draw(rng, SLOW_LEAD_M), draw(rng, SLOW_LEAD_MPS)
    ahead = flow_places(rng, FLOW_PER_H, draw(rng, LEAD_M), reach_m + BEYOND_M)
    behind = [-s for s in flow_places(rng, FLOW_PER_H, draw(rng, LEAD_M), BEYOND_M)]
    lane = _lane(rng, plan.main.curve, 0.0, 1, [*behind[::-1], *ahead])
    if rng.random() >= EVEN_CHANCE:
        return lane
    at = len(behind)
    return replace(
        lane,
        kinds=(*lane.kinds[:at], traffic_kind(rng), *lane.kinds[at:]),
        places=(*lane.places[:at], slow_lead[0], *lane.places[at:]),
        speeds=(*lane.speeds[:at], slow_lead[1], *lane.speeds[at:]),
    )


def drive_oncoming_lane(rng: np.random.Generator, plan: Plan, from_m: float) -> DrivenLane:
    """The lane beside it: who comes towards the ego, from `from_m` along the road on."""
    places = flow_places(rng, FLOW_PER_H, -from_m, BEYOND_M)
    return _lane(rng, plan.main.curve, LANE_WIDTH_M, -1, places)


def drive_side_street(
    rng: np.random.Generator, plan: Plan, joining: Joining
) -> tuple[DrivenLane, DrivenLane]:
    """A side street: who leaves along it, and who comes up to the main road and waits there."""
    nearest = plan.main.side(joining.sign).boundary_m
    curve = joining.road.curve
    leaving = flow_places(rng, FLOW_PER_H, nearest + 25.0, 2 * BEYOND_M)
    coming = [-s for s in flow_places(rng, FLOW_PER_H, nearest + 25.0, 2 * BEYOND_M)][::-1]
    # Drivers keep the standing gap before what stands: the first one, of whatever kind, stops with
    # its bumper before the pavement.
    stop = STANDING_GAP_M - nearest - CATALOGUE["bus"].size[0] / 2
    return (
        _lane(rng, curve, 0.0, 1, leaving),
        _lane(rng, curve, LANE_WIDTH_M, -1, coming, stop),
    )


def _lane(
    rng: np.random.Generator,
    curve: Curve,
    d: float,
    direction: int,
    places: list[float],
    stop_m: float = np.inf,
) -> DrivenLane:
    kinds = tuple(traffic_kind(rng) for _ in places)
    speeds = tuple(draw(rng, DRIVER_MPS) for _ in places)
    return DrivenLane(curve, d, direction, kinds, tuple(places), speeds, stop_m)
