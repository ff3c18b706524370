"""Furniture beside a road: houses, hedges, parked vehicles, a bus at its stop."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from care_sim.streets.draft import Draft
from care_sim.streets.layouts import Joining, Plan, Range, Road, Side, draw
from care_sim.world.bodies import CATALOGUE

OCCUPANCY: Range = (0.1, 0.85)
"""Occupied share of a parking lane, drawn per side: from a nearly empty street up to the 85% that
Shoup (2005, The High Cost of Free Parking) calls full.
"""
PARKING_GAP_M: Range = (0.6, 1.6)
"""Gap between bumpers: with the mean car, the 5.7 m that RASt 06 gives a vehicle along the kerb."""
PARKED_KINDS = {"car": 0.86, "van": 0.09, "truck": 0.05}
"""Annotations of nuScenes with attribute parked: 330 thousand cars, 56 thousand trucks (which cover
vans: two in three of those that park in a street)."""
OFF_KERB_M: Range = (-0.15, 0.15)
OFF_LINE: Range = (-0.03, 0.03)
"""Spread of a parked vehicle about the middle of its lane, metres, and about its direction,
radians.
"""
YARD_CHANCE = 0.2
YARD_M: Range = (3.0, 7.0)
"""Occasional gap in a closed front: an entrance to a yard."""
HOUSE_GAP_M: Range = (6.0, 12.0)
"""Gap between detached houses: twice the 3 m that German building codes keep from a boundary, and a
garage.
"""
GATE_WIDTH_M: Range = (1.0, 3.5)
"""Openings in a hedge, between every other two of its pieces: a gate, or a drive."""
GATE_CHANCE = 0.5
CORNER_M = 5.0
"""Nobody parks nearer to a junction (StVO, Sec. 12)."""
BUS_STOP_CHANCE = 0.25
"""A stop every 400 m, as is usual in town, and some 100 m of street per scene."""
CLOSE_M = 0.02
"""Gap between touching bodies."""
START_M: Range = (0.0, 3.0)
"""Begin of a row, so that rows do not begin alike."""
RETRY_M = 0.5
"""Steps of the search for a place."""
JOINING_M = 60.0
"""Furnished length of side streets: sight from the main road ends at 50 m."""

Span = tuple[float, float]


def furnish(draft: Draft, plan: Plan, span: Span, joining_m: float = JOINING_M) -> None:
    """Fill the main road over `span` (metres along it), and its side streets over `joining_m`."""
    # Reserved ground comes first, then the bus, which is longer than most gaps between other
    # bodies.
    for joining in plan.joinings:
        _keep_mouth_clear(draft, joining, plan.main, joining_m)
    if draft.rng.random() < BUS_STOP_CHANCE:
        _stop_bus(draft, plan.main, (0.0, span[1]))
    for side in plan.main.sides:
        _line_with_houses(draft, plan.main, side, span)
        _park(draft, plan.main, side, span)
    for joining in plan.joinings:
        beside = plan.main.side(joining.sign)
        for side in joining.road.sides:
            _line_with_houses(
                draft, joining.road, side, (beside.front_m, beside.front_m + joining_m)
            )
            _park(draft, joining.road, side, (beside.kerb_m + CORNER_M, beside.front_m + joining_m))


def _keep_mouth_clear(draft: Draft, joining: Joining, main: Road, reach_m: float) -> None:
    """Keep a side street's carriageway free, and the main road's parking lane at its corners."""
    road = joining.road
    right, left = road.sides
    kerb = main.side(joining.sign).kerb_m
    # A rectangle across the main road's half, as wide as the side street and two corners, and one
    # along the side street's lanes.
    corners = right.kerb_m + left.kerb_m + 2 * CORNER_M
    draft.reserve(road.curve.to_world(np.array([kerb / 2, road.middle_d, 0.0])), (kerb, corners))
    middle = (left.lane_edge_m - right.lane_edge_m) / 2
    draft.reserve(
        road.curve.to_world(np.array([reach_m, middle, 0.0])),
        (2 * reach_m, left.lane_edge_m + right.lane_edge_m),
    )


def _stop_bus(draft: Draft, road: Road, span: Span) -> None:
    """Place a bus at its stop, at the kerb; it juts out of the parking lane."""
    d = CATALOGUE["bus"].size[1] / 2 - road.right.kerb_m
    draft.stand("bus", road.curve.to_world(np.array([draft.rng.uniform(*span), d, 0.0])))


@dataclass(frozen=True)
class _Row:
    """Bodies one behind another at `d`, facing `heading`. `next_kind` draws a kind (None leaves the
    room of a car), `next_gap` a gap. They stand `off` the row by some metres, and are `turned` off
    it by some radians.
    """

    d: float
    next_kind: Callable[[], str | None]
    next_gap: Callable[[], float]
    heading: float = 0.0
    off: Range = (0.0, 0.0)
    turned: Range = (0.0, 0.0)

    def fill(self, draft: Draft, road: Road, span: Span) -> None:
        """Fill the row from end to end. Bodies without room are tried farther on."""
        s = span[0] + draw(draft.rng, START_M)
        kind = self.next_kind()
        while s < span[1]:
            # Metres along the line: beside it a bend makes them shorter or longer, so the larger
            # length is kept free.
            length = CATALOGUE[kind or "car"].size[0] * (
                1 + abs(road.curve.curvature_at(s) * self.d)
            )
            d = self.d + draw(draft.rng, self.off)
            heading = self.heading + draw(draft.rng, self.turned)
            if kind is None or draft.stand(
                kind, road.curve.to_world(np.array([s + length / 2, d, heading]))
            ):
                s += length + self.next_gap()
                kind = self.next_kind()
            else:
                s += RETRY_M


def _line_with_houses(draft: Draft, road: Road, side: Side, span: Span) -> None:
    """Place a closed front at the pavement, or detached houses behind gardens with hedges."""
    rng = draft.rng
    if not side.garden_m:
        _outside(side.front_m, side, "building", lambda: _draw_gap(rng, YARD_CHANCE, YARD_M)).fill(
            draft, road, span
        )
        return
    _outside(side.front_m, side, "house", lambda: draw(rng, HOUSE_GAP_M)).fill(draft, road, span)
    _outside(
        side.boundary_m, side, "hedge", lambda: _draw_gap(rng, GATE_CHANCE, GATE_WIDTH_M)
    ).fill(draft, road, span)


def _outside(edge_m: float, side: Side, kind: str, next_gap: Callable[[], float]) -> _Row:
    """Return a row of one kind that begins `edge_m` from the reference line."""
    return _Row(side.sign * (edge_m + CATALOGUE[kind].size[1] / 2), lambda: kind, next_gap)


def _park(draft: Draft, road: Road, side: Side, span: Span) -> None:
    """Fill a parking lane; the occupied share is drawn per side. Vehicles face in the direction of
    the nearest lane.
    """
    rng = draft.rng
    occupancy = draw(draft.rng, OCCUPANCY)
    lane = road.directions[0] if side.sign < 0 else road.directions[-1]
    kinds = list(PARKED_KINDS)
    shares = list(PARKED_KINDS.values())

    def next_kind() -> str | None:
        return str(rng.choice(kinds, p=shares)) if rng.random() < occupancy else None

    heading = 0.0 if lane > 0 else np.pi
    row = _Row(
        side.parking_d, next_kind, lambda: draw(rng, PARKING_GAP_M), heading, OFF_KERB_M, OFF_LINE
    )
    row.fill(draft, road, span)


def _draw_gap(rng: np.random.Generator, chance: float, gap: Range) -> float:
    """A drawn gap with a `chance`, else the least there is."""
    return draw(rng, gap) if rng.random() < chance else CLOSE_M
