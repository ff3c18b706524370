"""Drivers: the scripted ego, highway-env traffic on every road, and the flow that fills the lanes.

Each road has its own traffic, because highway-env's cost grows with the square of the vehicles.
Traffic drives on a straight line, which is then bent along the road. In a bend the lane beside the
reference line is a few per cent longer or shorter than the straight one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.types import Ego
from care_sim.streets.draft import STEP_S, TIMES, Draft
from care_sim.streets.layouts import (
    EVEN_CHANCE,
    LANE_WIDTH_M,
    SPEED_LIMIT_MPS,
    Curve,
    Joining,
    Plan,
    Range,
    Road,
    draw,
    place_on,
)
from care_sim.world.bodies import CATALOGUE
from care_sim.world.lane_flow import STANDING_GAP_M
from care_sim.world.traffic import RoadVehicle, Traffic

EGO_CRUISE_MPS: Range = (3.5, SPEED_LIMIT_MPS)
EGO_HALT_CHANCE = 0.5
EGO_HALT_AT_S: Range = (3.0, 14.0)
EGO_HALT_S: Range = (3.0, 8.0)
"""The ego cruises; in every other scene it comes to rest once, as before a light. Together with the
cruising speeds that makes about 16 km/h on average, that of the drives of nuScenes (Caesar et al.
2020, Sec. 2)."""
EGO_BRAKING_MPS2 = 2.0
EGO_STARTING_MPS2 = 1.5
"""Comfortable: less than half of what the closed loop's controller brakes with, and a usual start
in town.
"""

FLOW_PER_H: Range = (200.0, 400.0)
"""Vehicles per hour and direction of the main road: half of the 400 to 800 that RASt 06 gives for
both directions of a collector street. Their spacing is exponential beyond HEADWAY_S (Cowan 1975).
"""
SIDE_FLOW_PER_H: Range = (50.0, 200.0)
"""Flow of a side street: up to half of the 400 per hour that RASt 06 gives for both directions of a
residential street. Drives go through residential streets and take this flow on every road.
"""
HEADWAY_S = 3.0
"""Least time between vehicles: the equilibrium of IDM drivers at 30 km/h, so that nobody brakes at
once.
"""
DRIVER_MPS: Range = (7.0, SPEED_LIMIT_MPS)
"""Wanted speeds of oncoming drivers in a 30 km/h zone. Drivers in the ego's lane keep the limit,
since the ego does not react and must not be held up.
"""
TRAFFIC_KINDS = {"car": 0.78, "van": 0.08, "truck": 0.08, "bus": 0.06}
"""Shares in moving traffic. Annotations of nuScenes with attribute moving or stopped: 161 thousand
cars, 33 thousand trucks (which cover vans: half each), 13 thousand buses."""
VEHICLE_BERTH_M = 0.5
"""Least distance of people on foot or bicycle from a driving vehicle."""
LEAD_M: Range = (28.0, 60.0)
"""Gap to the next vehicle ahead: above the IDM's wanted gap at 30 km/h."""
BEYOND_M = 70.0
"""Extent of the street before the ego's first and beyond its last place: sight ends at 50 m."""


@dataclass(frozen=True)
class Drive:
    """The ego's scripted drive at every sample: world `poses` (t, 3), `motion`, and metres along
    the main road.
    """

    poses: Floats
    motion: tuple[Ego, ...]
    along: Floats


def ego_speeds(rng: np.random.Generator) -> Floats:
    """(t,) the ego's speed at every sample, m/s."""
    cruise = draw(rng, EGO_CRUISE_MPS)
    halts = rng.random() < EGO_HALT_CHANCE
    begins = draw(rng, EGO_HALT_AT_S)
    # Everything is drawn even if the ego does not halt, so that later draws stay the same.
    ends = begins + cruise / EGO_BRAKING_MPS2 + draw(rng, EGO_HALT_S)
    speeds = [cruise]
    for time in TIMES[:-1]:
        wanted = 0.0 if halts and begins <= time < ends else cruise
        least = speeds[-1] - EGO_BRAKING_MPS2 * STEP_S
        most = speeds[-1] + EGO_STARTING_MPS2 * STEP_S
        speeds.append(float(np.clip(wanted, least, most)))
    return np.array(speeds)


def drive_main(draft: Draft, plan: Plan) -> Drive:
    """Drive the ego and the main road's traffic; the ego's way is kept clear of walkers."""
    # The order of the draws is part of what a seed means, here and below.
    speeds = ego_speeds(draft.rng)
    reach = float(speeds.sum() * STEP_S)
    traffic = Traffic(
        plan.main.directions, ego_lane=0, lane_width=LANE_WIDTH_M, speed_limit=SPEED_LIMIT_MPS
    )
    ego = traffic.add_ego(0.0, speeds[0], CATALOGUE["ego"])
    drivers = _queue(draft, traffic, reach)
    if len(plan.main.directions) > 1:
        drivers += _oncoming(draft, traffic, reach)
    ways = _run(traffic, [ego, *(vehicle for _, vehicle in drivers)], speeds)
    drive = _drive(plan.main.curve, ways[:, 0], speeds)
    draft.obstruct(drive.poses, CATALOGUE["ego"].size[:2], 2 * VEHICLE_BERTH_M)
    for (kind, _), way in zip(drivers, np.moveaxis(ways[:, 1:], 1, 0), strict=True):
        draft.drive(kind, plan.main.curve.to_world(way), VEHICLE_BERTH_M)
    return drive


def drive_joining(draft: Draft, joining: Joining, main: Road) -> None:
    """Drive a side street's traffic. Some vehicles leave along it. Others come up to the main road,
    give way and wait before its pavement.
    """
    road = joining.road
    nearest = main.side(joining.sign).boundary_m
    traffic = Traffic(
        road.directions, ego_lane=0, lane_width=LANE_WIDTH_M, speed_limit=SPEED_LIMIT_MPS
    )
    leaving = draw_flow(draft.rng, SIDE_FLOW_PER_H, nearest + 5.0, BEYOND_M)
    coming = draw_flow(draft.rng, SIDE_FLOW_PER_H, nearest + 25.0, 2 * BEYOND_M)
    drivers = [_driver(draft, traffic, s, 0) for s in leaving] + [
        _driver(draft, traffic, s, 1) for s in coming
    ]
    # The line is the middle of the first vehicle that stops with its bumper before the pavement.
    if coming:
        first = CATALOGUE[drivers[len(leaving)][0]]
        traffic.add_stop_line(nearest + first.size[0] / 2, 1)
    ways = _run(traffic, [vehicle for _, vehicle in drivers])
    for (kind, _), way in zip(drivers, np.moveaxis(ways, 1, 0), strict=True):
        draft.drive(kind, road.curve.to_world(way), VEHICLE_BERTH_M)


Driver = tuple[str, RoadVehicle]
"""A vehicle and its kind."""


def _queue(draft: Draft, traffic: Traffic, reach: float) -> list[Driver]:
    """Return the vehicles that drive along with the ego, ahead of it and behind."""
    ahead = draw_flow(draft.rng, FLOW_PER_H, draw(draft.rng, LEAD_M), reach + BEYOND_M)
    behind = [-s for s in draw_flow(draft.rng, FLOW_PER_H, draw(draft.rng, LEAD_M), BEYOND_M)]
    return [_driver(draft, traffic, s, 0, SPEED_LIMIT_MPS) for s in ahead + behind]


def _oncoming(draft: Draft, traffic: Traffic, reach: float) -> list[Driver]:
    """Return oncoming vehicles, up to the distance from which they still meet the ego."""
    farthest = reach + BEYOND_M + SPEED_LIMIT_MPS * float(TIMES[-1])
    return [
        _driver(draft, traffic, s, 1) for s in draw_flow(draft.rng, FLOW_PER_H, -BEYOND_M, farthest)
    ]


def draw_flow(
    rng: np.random.Generator, flow_per_h: Range, first: float, last: float
) -> list[float]:
    """Draw places along a lane, from `first` to `last`, of vehicles at the speed limit."""
    # Cowan's headway: a least one, plus an exponential rest with the flow's mean.
    mean_s = 3600.0 / draw(rng, flow_per_h)
    places = []
    place = first + rng.exponential(mean_s - HEADWAY_S) * SPEED_LIMIT_MPS
    while place < last:
        places.append(float(place))
        place += (HEADWAY_S + rng.exponential(mean_s - HEADWAY_S)) * SPEED_LIMIT_MPS
    return places


def _driver(
    draft: Draft, traffic: Traffic, s: float, lane: int, speed: float | None = None
) -> Driver:
    kind = traffic_kind(draft.rng)
    wanted = draw(draft.rng, DRIVER_MPS) if speed is None else speed
    return kind, traffic.add_driver(s, lane, wanted, CATALOGUE[kind])


def traffic_kind(rng: np.random.Generator) -> str:
    """Draw the kind of a driving vehicle."""
    return str(rng.choice(list(TRAFFIC_KINDS), p=list(TRAFFIC_KINDS.values())))


def _run(traffic: Traffic, vehicles: list[RoadVehicle], ego_speeds: Floats | None = None) -> Floats:
    """Return (t, n, 3) road places of vehicles at every sample; with speeds the first one is the
    ego.
    """
    ways = np.empty((len(TIMES), len(vehicles), 3))
    for sample in range(len(TIMES)):
        ways[sample] = np.array([vehicle.pose for vehicle in vehicles]).reshape(-1, 3)
        # The ego gets the acceleration that brings it to its next scripted speed.
        if ego_speeds is not None and sample + 1 < len(TIMES):
            vehicles[0].accelerate((ego_speeds[sample + 1] - ego_speeds[sample]) / STEP_S, STEP_S)
        traffic.step(STEP_S)
    return ways


def _drive(curve: Curve, way: Floats, speeds: Floats) -> Drive:
    along = way[:, 0]
    # The ego keeps to the reference line, so its yaw rate is the line's curvature times its speed.
    rates = [
        speed * curve.curvature_at(s)
        for s, speed in zip(along.tolist(), speeds.tolist(), strict=True)
    ]
    accelerations = np.diff(speeds, prepend=speeds[0]) / STEP_S
    motion = tuple(
        Ego(*values) for values in zip(speeds.tolist(), rates, accelerations.tolist(), strict=True)
    )
    return Drive(curve.to_world(way), motion, along)


SLOW_LEAD_M: Range = (22.0, 27.0)
SLOW_LEAD_MPS: Range = (5.6, DRIVER_MPS[0])
"""Gap to a slow vehicle ahead, which looks for a place to park at 20 to 25 km/h: the IDM gap at
that speed, or a little more. No other vehicle starts that near.
"""


@dataclass(frozen=True)
class DrivenLane:
    """A lane `d` metres left of its road's line, along it (`direction` +1) or against it.

    `places` (n,) are metres in driving direction, s or -s, ascending; `speeds` are m/s. `stop_m` is
    where the first vehicle gives way, inf if it need not.
    """

    curve: Curve
    d: float
    direction: int
    kinds: tuple[str, ...]
    places: tuple[float, ...]
    speeds: tuple[float, ...]
    stop_m: float = np.inf


class LanePoses:
    """World poses of the vehicles of lanes, lane by lane."""

    def __init__(self, lanes: Sequence[DrivenLane]):
        counts = [len(lane.kinds) for lane in lanes]
        rows = [
            (*one.curve.line[0], one.direction, one.d, np.pi * (one.direction < 0)) for one in lanes
        ]
        columns = np.repeat(np.array(rows, float).reshape(-1, 11), counts, axis=0)
        self._lines, self._on_road = columns[:, :8].copy(), columns[:, 8:].copy()

    def __call__(self, places: Floats) -> Floats:
        """(..., n, 3) world poses of the n vehicles at `places` (..., n)."""
        rows = np.empty((*places.shape, 3))
        rows[...] = self._on_road
        rows[..., 0] *= places
        return place_on(self._lines, rows.reshape(-1, 3)).reshape(rows.shape)


def drive_own_lane(rng: np.random.Generator, plan: Plan, reach_m: float) -> DrivenLane:
    """Draw the vehicles ahead and behind in the ego's lane, which the ego drives for `reach_m`. In
    half of the drives the vehicle ahead is near and slow.
    """
    slow_lead = draw(rng, SLOW_LEAD_M), draw(rng, SLOW_LEAD_MPS)
    ahead = draw_flow(rng, SIDE_FLOW_PER_H, draw(rng, LEAD_M), reach_m + BEYOND_M)
    behind = [-s for s in draw_flow(rng, SIDE_FLOW_PER_H, draw(rng, LEAD_M), BEYOND_M)]
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
    """Draw the oncoming vehicles of the next lane, from `from_m` along the road on."""
    places = draw_flow(rng, SIDE_FLOW_PER_H, -from_m, BEYOND_M)
    return _lane(rng, plan.main.curve, LANE_WIDTH_M, -1, places)


def drive_side_street(
    rng: np.random.Generator, plan: Plan, joining: Joining
) -> tuple[DrivenLane, DrivenLane]:
    """Draw the vehicles of a side street: those leaving along it, and those waiting at the main
    road.
    """
    nearest = plan.main.side(joining.sign).boundary_m
    curve = joining.road.curve
    leaving = draw_flow(rng, SIDE_FLOW_PER_H, nearest + 25.0, 2 * BEYOND_M)
    coming = [-s for s in draw_flow(rng, SIDE_FLOW_PER_H, nearest + 25.0, 2 * BEYOND_M)][::-1]
    # Drivers keep the standing gap before an obstacle: the first vehicle of any kind stops with its
    # bumper before the pavement.
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
