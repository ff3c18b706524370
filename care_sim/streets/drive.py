"""A drive: a street with the way that the ego takes through it, and whom it meets. Pure data, drawn
from a seed.

The street is that of `care_sim.streets.street`, with layouts, furniture and people from the same
ranges. But nobody crosses a road by chance: every crossing is one of `encounters`, and who walks
else stays on the pavements.
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
"""Kept free on either side of who comes."""
VIEW_M = 0.6
"""Kept free along every line of sight: twice what is to be seen of who comes."""


def keep_room(draft: Draft, encounter: Encounter) -> bool:
    """Put up the occluder and keep free of what stands the way of who comes, and the lines along
    which the ego sees them. Says whether there was room; without it nothing is changed.
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
    """Let nobody else walk or cycle where the ego drives over pavements, cycle lanes and
    carriageways, nor through those who are met. `span` is that of the main road.
    """
    main = plan.main
    kept = []
    if plan.joinings:
        # Who walks along a side street would else go on straight over the main road.
        kept.append(_rectangle(main.curve, span, (-main.right.lane_edge_m, main.left.lane_edge_m)))
    if turned_into is not None:
        side, road = main.side(turned_into.sign), turned_into.road
        mouth = (-road.right.kerb_m, road.left.kerb_m)
        # With the cycle lane: nobody who cycles along the main road is to give way to the ego.
        kept.append(_rectangle(road.curve, (side.lane_edge_m, side.boundary_m), mouth))
    for one in encounters:
        length, width, _ = CATALOGUE[one.who].size
        to_d = one.from_d - one.side * one.walk.length_m
        # A car drives over both pavements; who walks only comes to stand on the far one.
        from_d = one.from_d if one.who == "car" else to_d
        beyond = np.sign(to_d - from_d) * length / 2 if from_d != to_d else length / 2
        ends = from_d - beyond, to_d + beyond
        kept.append(_rectangle(one.curve, (one.s - width / 2, one.s + width / 2), ends))
    for pose, size in kept:
        draft.obstruct(np.repeat(pose.reshape(1, 3), len(draft.times), axis=0), size, BESIDE_M)


def _rectangle(curve: Curve, along: Span, across: Span) -> tuple[Floats, Footprint]:
    """The world pose (3,) and the footprint of a rectangle on a road: from where to where along its
    line, and to its left.
    """
    middle = np.array([sum(along) / 2, sum(across) / 2, 0.0])
    return curve.to_world(middle), (abs(along[1] - along[0]), abs(across[1] - across[0]))


CRUISE_MPS: Range = (7.0, SPEED_LIMIT_MPS)
"""From what the slowest of the other drivers want to the limit."""
LENGTH_M: Range = (160.0, 260.0)
"""Of the way: 20 to 35 s when nothing holds the ego up, room for three encounters."""
TURN_RADIUS_M = {-1: 7.0, 1: 10.0}
"""To the right and to the left, where the ego turns off: both above the 5.5 m that a passenger car
can turn within, with the room of a lane to the kerb."""
TURN_CHANCE = 0.75
"""Where there is a side street, so that one drive in four turns off, as many as go round a bend."""
FIRST_M = 40.0
APART_M = 42.0
SHIFT_M: Range = (0.0, 12.0)
"""Places of encounters: five seconds of approach before the first, so that every track settles, and
as much between two, less what each is shifted by.
"""
MOUTH_M = 22.0
"""On the main road no encounter is this near to the middle of a side street, whose mouth must be
clear.
"""
EXIT_M = 12.0
"""Where the ego turns off, who comes crosses the side street this far behind the main road's
pavement or less: as in Euro NCAP's turning tests (CPTA), 8 to 11 m from its lane, up to the first
lorry that may park."""
SIDEWAYS_MPS2 = 2.0
"""Through a bend: two thirds of the 3 m/s^2 that UN Regulation 79 allows automated steering."""
COMFORT_MPS2 = 1.5
"""Slowing for a bend and gaining speed after it: as the controller gains speed after braking."""
SAMPLE_S = 0.2
"""Between two samples of a walker's way: nobody on a pavement moves further than half of its own
length in it."""


@dataclass(frozen=True)
class Stretch:
    """Part of the way: the ego goes along `road` from `from_m` to `to_m` of its route, and its s on
    the road is the route's less `offset_m`.
    """

    road: Road
    from_m: float
    to_m: float
    offset_m: float


@dataclass(frozen=True)
class Drive:
    """Everything that is drawn for a drive.

    The ego goes `goal_m` along the route of its `plan`. `kinds` (n,) stand or walk on `ways`
    (n, t, 3), sampled every SAMPLE_S seconds. `encounters` are in the order of the route.
    `stretches` say which road the ego drives on.
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
    """A drive of at most `duration_s` seconds that holds `wanted` encounters, and with
    `turn_chance` turns off where there is a side street. Nothing outside the generator enters.
    """
    # Each part has a stream of its own, so that a change in one does not draw the others anew.
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
    """The side street that the ego turns into, if it does."""
    if not plan.joinings or rng.random() >= chance:
        return None
    return plan.joinings[int(rng.integers(len(plan.joinings)))]


def _way(
    plan: Plan, turned_into: Joining | None, length: float
) -> tuple[Route, tuple[Stretch, ...]]:
    """The ego's route, about `length` long, and the roads that it goes along."""
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
    # How many is drawn evenly: in a quarter of the drives there is nothing to brake for.
    number = min(int(rng.choice(wanted.most + 1)), len(places))
    corner = _corner(rng, plan, stretches)
    spots = [*corner, *_others(places, corner, plan, stretches)]
    # All are drawn, then as many are taken as there shall be and have room: first at the corner.
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
    """Where the ego turns off, the mouth of the side street; else in its bend, if there is one."""
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
    """Where else along the way somebody can be met: away from the corner, and from the mouths of
    streets.
    """
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
    """All lanes that somebody drives in. Where the ego turns left, nobody comes towards it: giving
    way is not asked of it.
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
