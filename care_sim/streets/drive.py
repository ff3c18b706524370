"""A drive: a street with the way that the ego takes through it, and whom it meets. Pure data, drawn
from a seed.

The street is that of `care_sim.streets.street`, with layouts, furniture and people from the same
ranges. But nobody crosses a road by chance: every crossing is one of `encounters`, and who walks
else stays on the pavements.
"""

from dataclasses import dataclass

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.streets.dimensions import SPEED_LIMIT_MPS, Range, draw
from care_sim.streets.draft import Draft
from care_sim.streets.drive_traffic import (
    DrivenLane,
    drive_oncoming_lane,
    drive_own_lane,
    drive_side_street,
)
from care_sim.streets.drivers import BEYOND_M
from care_sim.streets.encounters import Encounter, draw_encounter
from care_sim.streets.furniture import furnish
from care_sim.streets.layouts import LAYOUTS, Joining, Plan, Road
from care_sim.streets.people import populate
from care_sim.streets.room import VIEW_M, keep_room, keep_walkers_off
from care_sim.world.route import Route, through

CRUISE_MPS: Range = (7.0, SPEED_LIMIT_MPS)
"""From what the slowest of the other drivers want to the limit."""
LENGTH_M: Range = (160.0, 260.0)
"""Of the way: 20 to 35 s when nothing holds the ego up, room for three encounters."""
TURN_RADIUS_M = {-1: 7.0, 1: 10.0}
"""To the right and to the left, where the ego turns off: both above the 5.5 m that a passenger car
can turn within, with the room of a lane to the kerb."""
TURN_CHANCE = 0.75
"""Where there is a side street, so that one drive in four turns off, as many as go round a bend."""
ENCOUNTERS = (0, 1, 2, 3)
"""How many a drive has, evenly: in a quarter of them there is nothing to brake for."""
FIRST_M = 40.0
APART_M = 42.0
SHIFT_M: Range = (0.0, 12.0)
"""Places of encounters: five seconds of approach before the first, so that every track settles, and
as much between two, less what each is shifted by.
"""
AFTER_BEND_M = 25.0
"""Behind a turn the ego needs this much to be back at its speed, and before it as much to slow."""
MOUTH_M = 22.0
"""No encounter is this near to the middle of a side street, whose mouth must be clear."""
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
    """What is drawn of a drive.

    `goal_m` is how far along its `route` the ego goes. `kinds` (n,) stand or walk on `ways`
    (n, t, 3), sampled every SAMPLE_S seconds. `encounters` come with where on the route their lines
    are. `stretches` say which road the ego drives on.
    """

    route: Route
    goal_m: float
    cruise_mps: float
    stretches: tuple[Stretch, ...]
    lanes: tuple[DrivenLane, ...]
    kinds: tuple[str, ...]
    ways: Floats
    encounters: tuple[tuple[float, Encounter], ...]


def draw_drive(rng: np.random.Generator, duration_s: float) -> Drive:
    """A drive of at most `duration_s` seconds. Nothing outside the generator enters."""
    # Each part has a stream of its own, so that a change in one does not draw the others anew.
    plans, meeting, traffic, furniture, people = (
        np.random.default_rng(child)
        for child in np.random.SeedSequence(rng.integers(2**32, size=4).tolist()).spawn(5)
    )
    plan = LAYOUTS[str(plans.choice(list(LAYOUTS)))](plans)
    turned_into = _turned_into(plans, plan)
    goal = draw(plans, LENGTH_M)
    cruise = draw(plans, CRUISE_MPS)
    route, stretches = _way(plan, turned_into, goal + BEYOND_M)

    times = SAMPLE_S * np.arange(round(duration_s / SAMPLE_S) + 1, dtype=np.float64)
    draft = Draft(furniture, times)
    encounters = _encounters(meeting, draft, plan, stretches, goal)
    last = min(goal, stretches[0].to_m) + BEYOND_M
    side_m = BEYOND_M + (goal - stretches[-1].offset_m if turned_into else 0.0)
    furnish(draft, plan, (-BEYOND_M, last), side_m)
    keep_walkers_off(draft, plan, turned_into, [one for _, one in encounters], (-BEYOND_M, last))
    draft.rng = people
    populate(draft, plan.main, (-BEYOND_M, last))
    for joining in plan.joinings:
        populate(draft, joining.road, (plan.main.side(joining.sign).front_m, side_m))
    lanes = _lanes(traffic, plan, turned_into, last, duration_s)
    return Drive(
        route, goal, cruise, stretches, lanes, tuple(draft.kinds), np.stack(draft.ways), encounters
    )


def _turned_into(rng: np.random.Generator, plan: Plan) -> Joining | None:
    """The side street that the ego turns into, if it does."""
    if not plan.joinings or rng.random() >= TURN_CHANCE:
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
    rng: np.random.Generator, draft: Draft, plan: Plan, stretches: tuple[Stretch, ...], goal: float
) -> tuple[tuple[float, Encounter], ...]:
    """Who is met, in the order of the way, with the places along the route."""
    places = [
        place + draw(rng, SHIFT_M) for place in np.arange(FIRST_M, goal - SHIFT_M[1], APART_M)
    ]
    wanted = min(int(rng.choice(ENCOUNTERS)), len(places))
    # All are drawn, then as many are taken as there shall be and have room.
    found: list[tuple[float, Encounter]] = []
    for number in rng.permutation(len(places)).tolist():
        for stretch in stretches:
            s = places[number] - stretch.offset_m
            if len(found) < wanted and _is_open(plan, stretch, places[number], s):
                encounter = draw_encounter(rng, stretch.road, s)
                if encounter and keep_room(draft, stretch.road, encounter):
                    found.append((places[number], encounter))
    return tuple(sorted(found, key=lambda one: one[0]))


def _is_open(plan: Plan, stretch: Stretch, along: float, s: float) -> bool:
    """Whether there can be an encounter: in no bend, nor where the ego turns, nor at the mouth of a
    street.
    """
    # Sight lines are reckoned for a straight road; no bend is shorter than these steps.
    curve = stretch.road.curve
    bends = any(curve.curvature_at(s - back) for back in (VIEW_M, VIEW_M / 2, 0.0))
    if bends or not stretch.from_m <= along < stretch.to_m:
        return False
    # What the ego turns out of, or into, is a stretch that begins or ends within the way.
    before = AFTER_BEND_M if stretch.from_m > 0 else 0.0
    if along < stretch.from_m + before:
        return False
    if stretch.road is not plan.main:
        return s > plan.main.right.front_m + MOUTH_M
    return all(abs(s - joining.at_m) > MOUTH_M for joining in plan.joinings)


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
