"""A drive: a street with the ego's route through it, and its encounters. Pure data, drawn from a
seed.

The street is that of `care_sim.streets.street`, with layouts, furniture and people from the same
ranges. But all crossings are `encounters`; other walkers stay on the pavements.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.streets.draft import Draft, Footprint, PlacedBodies
from care_sim.streets.drivers import (
    BEYOND_M,
    DrivenLane,
    drive_oncoming_lane,
    drive_own_lane,
    drive_side_street,
)
from care_sim.streets.encounters import ANYBODY, Encounter, Spot, Wanted, draw_encounter
from care_sim.streets.furniture import Span, furnish
from care_sim.streets.layouts import (
    LAYOUTS,
    SPEED_LIMIT_MPS,
    Curve,
    Joining,
    Plan,
    Range,
    Road,
    draw,
)
from care_sim.streets.people import populate
from care_sim.streets.sight import Approach
from care_sim.world.bodies import CATALOGUE
from care_sim.world.route import Route, SpeedPlan, through

BESIDE_M = 0.3
"""Free room on either side of a comer, metres."""
VIEW_M = 0.6
"""Free width along every line of sight: twice the visible part of a comer."""


def keep_room(draft: Draft, encounter: Encounter) -> bool:
    """Put up the occluder, and keep the comer's way and the ego's lines of sight free of standing
    bodies. Returns False, and changes nothing, if there is no room.
    """
    length, width, _ = CATALOGUE[encounter.who].size
    s = encounter.s
    start = encounter.from_d + encounter.side * (length / 2 + BESIDE_M)
    end = encounter.from_d - encounter.side * (encounter.walk.length_m + length / 2 + BESIDE_M)
    aside = width / 2 + BESIDE_M
    way = _rectangle(encounter.curve, (s - aside, s + aside), (start, end))
    free = PlacedBodies()
    free.add(way[0].reshape(1, 3), way[1], 0.0)
    occluder = np.array(encounter.occluder_pose)
    if free.meets(occluder.reshape(1, 3), CATALOGUE[encounter.occluder].size[:2]):
        return False
    if not draft.has_room(*way) or not draft.stand(encounter.occluder, occluder):
        return False
    draft.reserve(*way)
    for eye, seen in encounter.sight.lines:
        (x, y), (to_x, to_y) = eye, seen
        pose = (x + to_x) / 2, (y + to_y) / 2, np.arctan2(to_y - y, to_x - x)
        draft.reserve(np.array(pose), (float(np.hypot(to_x - x, to_y - y)), VIEW_M))
    return True


def keep_walkers_off(
    draft: Draft,
    plan: Plan,
    turned_into: Joining | None,
    encounters: Sequence[Encounter],
    span: Span,
) -> None:
    """Keep other walkers and cyclists off the ego's way over pavements, cycle lanes and
    carriageways, and off the comers. `span` is that of the main road.
    """
    main = plan.main
    kept = []
    if plan.joinings:
        # Otherwise walkers along a side street would cross the main road.
        kept.append(_rectangle(main.curve, span, (-main.right.lane_edge_m, main.left.lane_edge_m)))
    if turned_into is not None:
        side, road = main.side(turned_into.sign), turned_into.road
        mouth = (-road.right.kerb_m, road.left.kerb_m)
        # With the cycle lane, so that cyclists along the main road need not give way to the ego.
        kept.append(_rectangle(road.curve, (side.lane_edge_m, side.boundary_m), mouth))
    for one in encounters:
        length, width, _ = CATALOGUE[one.who].size
        to_d = one.from_d - one.side * one.walk.length_m
        # A car drives over both pavements; a walker stops on the far one.
        from_d = one.from_d if one.who == "car" else to_d
        beyond = np.sign(to_d - from_d) * length / 2 if from_d != to_d else length / 2
        ends = from_d - beyond, to_d + beyond
        kept.append(_rectangle(one.curve, (one.s - width / 2, one.s + width / 2), ends))
    for pose, size in kept:
        draft.obstruct(np.repeat(pose.reshape(1, 3), len(draft.times), axis=0), size, BESIDE_M)


def _rectangle(curve: Curve, along: Span, across: Span) -> tuple[Floats, Footprint]:
    """Return the world pose (3,) and the footprint of a rectangle on a road, given by its ends
    along the line and to its left.
    """
    middle = np.array([sum(along) / 2, sum(across) / 2, 0.0])
    return curve.to_world(middle), (abs(along[1] - along[0]), abs(across[1] - across[0]))


CRUISE_MPS: Range = (7.0, SPEED_LIMIT_MPS)
"""Speeds from the slowest other drivers' wanted speed to the limit."""
LENGTH_M: Range = (160.0, 260.0)
"""Length of the way: 20 to 35 s of free driving, room for three encounters."""
TURN_RADIUS_M = {-1: 7.0, 1: 10.0}
"""Radius of a right and of a left turn. Both exceed the 5.5 m of a passenger car, with the room of
a lane to the kerb.
"""
TURN_CHANCE = 0.75
"""Chance of turning off at a side street: one drive in four turns off, as many as go round a
bend.
"""
FIRST_M = 40.0
APART_M = 42.0
SHIFT_M: Range = (0.0, 12.0)
"""Places of encounters: five seconds of approach before the first, so that every track settles, and
equally much between two, minus random shifts.
"""
MOUTH_M = 22.0
"""Least distance of an encounter on the main road from the middle of a side street, whose mouth
must be clear.
"""
EXIT_M = 12.0
"""Largest distance of a comer's crossing from the main road's pavement, if the ego turns off. As in
Euro NCAP's turning tests (CPTA), 8 to 11 m from its lane, up to the first lorry that may park.
"""
SIDEWAYS_MPS2 = 2.0
"""Sideways acceleration in a bend: two thirds of the 3 m/s^2 that UN Regulation 79 allows automated
steering.
"""
COMFORT_MPS2 = 1.5
"""Acceleration before and after a bend, as of the controller after braking."""
SAMPLE_S = 0.2
"""Seconds between samples of a walker's way: nobody on a pavement moves more than half of its own
length meanwhile.
"""


@dataclass(frozen=True)
class Stretch:
    """Part of the way: the ego is on `road` from `from_m` to `to_m` of its route. Its s on the road
    is the route's minus `offset_m`.
    """

    road: Road
    from_m: float
    to_m: float
    offset_m: float


@dataclass(frozen=True)
class Drive:
    """All draws of a drive.

    The ego goes `goal_m` along the route of its `plan`. `kinds` (n,) stand or walk on `ways` (n, t,
    3), sampled every SAMPLE_S seconds. `encounters` are in the order of the route. `stretches` are
    the roads of the ego's way.
    """

    plan: SpeedPlan
    goal_m: float
    stretches: tuple[Stretch, ...]
    lanes: tuple[DrivenLane, ...]
    kinds: tuple[str, ...]
    ways: Floats
    encounters: tuple[Encounter, ...]


def draw_drive(
    rng: np.random.Generator,
    duration_s: float,
    wanted: Wanted = ANYBODY,
    turn_chance: float = TURN_CHANCE,
) -> Drive:
    """Draw a drive of at most `duration_s` seconds with `wanted` encounters. It turns off with
    `turn_chance` if there is a side street. The draw depends only on the generator.
    """
    # Each part has its own stream, so that a change of one leaves the others' draws.
    plans, meeting, traffic, furniture, people = (
        np.random.default_rng(child)
        for child in np.random.SeedSequence(rng.integers(2**32, size=4).tolist()).spawn(5)
    )
    plan = LAYOUTS[str(plans.choice(list(LAYOUTS)))](plans)
    turned_into = _turned_into(plans, plan, turn_chance)
    goal = draw(plans, LENGTH_M)
    cruise = draw(plans, CRUISE_MPS)
    route, stretches = _way(plan, turned_into, goal + BEYOND_M)
    speed_plan = SpeedPlan(route, cruise, SIDEWAYS_MPS2, COMFORT_MPS2)

    times = SAMPLE_S * np.arange(round(duration_s / SAMPLE_S) + 1, dtype=np.float64)
    draft = Draft(furniture, times)
    encounters = _encounters(meeting, draft, plan, stretches, goal, speed_plan, wanted)
    last = min(goal, stretches[0].to_m) + BEYOND_M
    side_m = BEYOND_M + (goal - stretches[-1].offset_m if turned_into else 0.0)
    furnish(draft, plan, (-BEYOND_M, last), side_m)
    keep_walkers_off(draft, plan, turned_into, encounters, (-BEYOND_M, last))
    draft.rng = people
    populate(draft, plan.main, (-BEYOND_M, last))
    for joining in plan.joinings:
        populate(draft, joining.road, (plan.main.side(joining.sign).front_m, side_m))
    lanes = _lanes(traffic, plan, turned_into, last, duration_s)
    return Drive(
        speed_plan, goal, stretches, lanes, tuple(draft.kinds), np.stack(draft.ways), encounters
    )


def _turned_into(rng: np.random.Generator, plan: Plan, chance: float) -> Joining | None:
    """Return the side street that the ego turns into, if any."""
    if not plan.joinings or rng.random() >= chance:
        return None
    return plan.joinings[int(rng.integers(len(plan.joinings)))]


def _way(
    plan: Plan, turned_into: Joining | None, length: float
) -> tuple[Route, tuple[Stretch, ...]]:
    """Return the ego's route, about `length` long, and its roads."""
    curve = plan.main.curve
    if turned_into is None:
        legs = [
            (curve.bend_at, 0.0),
            (curve.bend_length, curve.curvature),
            (length - curve.bend_at - curve.bend_length, 0.0),
        ]
        route = Route(curve.start, tuple(leg for leg in legs if leg[0] > 0))
        return route, (Stretch(plan.main, 0.0, length, 0.0),)

    # Both lines are straight: the corner is where they meet.
    x, y, heading = turned_into.road.curve.start
    corner = x - y / np.tan(heading), 0.0
    reach = length - corner[0]
    end = corner[0] + reach * np.cos(heading), reach * np.sin(heading)
    route = through([(0.0, 0.0), corner, end], TURN_RADIUS_M[turned_into.sign])
    bends, turns = route.legs[0][0], route.legs[0][0] + route.legs[1][0]
    far = turned_into.road.curve.to_world(np.array([[reach / 2, 0.0, 0.0]]))
    offset = float(route.places(far[:, :2])[0, 0]) - reach / 2
    return route, (
        Stretch(plan.main, 0.0, bends, 0.0),
        Stretch(turned_into.road, turns, route.length, offset),
    )


def _encounters(
    rng: np.random.Generator,
    draft: Draft,
    plan: Plan,
    stretches: tuple[Stretch, ...],
    goal: float,
    speed_plan: SpeedPlan,
    wanted: Wanted,
) -> tuple[Encounter, ...]:
    """Return the encounters, in the order of the way."""
    places = [
        place + draw(rng, SHIFT_M) for place in np.arange(FIRST_M, goal - SHIFT_M[1], APART_M)
    ]
    # The number is uniform: a quarter of the drives has nothing to brake for.
    number = min(int(rng.choice(wanted.most + 1)), len(places))
    corner = _corner(rng, plan, stretches)
    spots = [*corner, *_others(places, corner, plan, stretches)]
    # All are drawn, then taken while they have room, up to the number, the corner first.
    order = [*range(len(corner)), *(len(corner) + rng.permutation(len(spots) - len(corner)))]
    found: list[Encounter] = []
    for spot in (spots[place] for place in order):
        if len(found) == number:
            break
        from_m, to_m = spot.along_m
        one = draw_encounter(rng, spot, Approach.along(speed_plan, from_m, to_m), wanted)
        if one and keep_room(draft, one):
            found.append(one)
    return tuple(sorted(found, key=lambda one: one.along_m))


def _corner(
    rng: np.random.Generator, plan: Plan, stretches: tuple[Stretch, ...]
) -> tuple[Spot, ...]:
    """Return the mouth of the side street if the ego turns off, else the bend, if there is one."""
    main, *into = stretches
    if into:
        (leaving,) = into
        joining = next(one for one in plan.joinings if one.road is leaving.road)
        beside = plan.main.side(joining.sign)
        within = beside.boundary_m, beside.boundary_m + EXIT_M
        return (Spot(leaving.road, within, leaving.offset_m, beside, corner=True),)
    curve = main.road.curve
    begins, ends = max(curve.bend_at, FIRST_M), curve.bend_at + curve.bend_length
    if ends <= begins:
        return ()
    s = draw(rng, (begins, ends))
    return (Spot(main.road, (s, s)),)


def _others(
    places: list[float], corner: tuple[Spot, ...], plan: Plan, stretches: tuple[Stretch, ...]
) -> Iterator[Spot]:
    """Return other spots along the way: away from the corner, and from the mouths of streets."""
    apart = APART_M - SHIFT_M[1]
    for along in places:
        if any(one.along_m[0] - apart < along < one.along_m[1] + apart for one in corner):
            continue
        for stretch in stretches:
            s = along - stretch.offset_m
            if not stretch.from_m <= along < stretch.to_m:
                continue
            if stretch.road is plan.main:
                if all(abs(s - joining.at_m) > MOUTH_M for joining in plan.joinings):
                    yield Spot(stretch.road, (s, s))
            elif s > corner[0].within_m[1]:
                yield Spot(stretch.road, (s, s), stretch.offset_m, corner[0].beside)


def _lanes(
    rng: np.random.Generator,
    plan: Plan,
    turned_into: Joining | None,
    last: float,
    duration_s: float,
) -> tuple[DrivenLane, ...]:
    """Return all lanes with traffic. If the ego turns left, no lane is oncoming, so that the ego
    need not give way.
    """
    sides = {joining.sign: drive_side_street(rng, plan, joining) for joining in plan.joinings}
    own = [drive_own_lane(rng, plan, last)]
    others: list[DrivenLane] = []
    for sign, (leaving, coming) in sides.items():
        into = turned_into is not None and turned_into.sign == sign
        (own if into else others).append(leaving)
        others.append(coming)
    to_the_left = turned_into is not None and turned_into.sign > 0
    if len(plan.main.directions) > 1 and not to_the_left:
        others.append(drive_oncoming_lane(rng, plan, last + SPEED_LIMIT_MPS * duration_s))
    return tuple(lane for lane in (*own, *others) if lane.kinds)
