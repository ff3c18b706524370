"""The room that planned encounters need: what must stay free so that they happen as drawn."""

from collections.abc import Sequence

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.streets.curve import Curve
from care_sim.streets.draft import Draft, PlacedBodies
from care_sim.streets.encounters import Encounter
from care_sim.streets.footprints import Footprint
from care_sim.streets.furniture import Span
from care_sim.streets.layouts import Joining, Plan
from care_sim.world.bodies import CATALOGUE

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
