"""Encounters in a drive: people and vehicles that come out into the ego's way, drawn from stated
ranges.

Each has a line across the road, a body that hides who waits there, and an outcome for an ego that
drives on as it means to: a conflict, a near miss, or a stop at the edge of the carriageway. Who
waits sets off when the ego is a drawn time away, so that a conflict stays one after earlier
braking.

All is reckoned along the way that the ego means to drive, with its speeds and through its bends and
turns. Who comes is in sight for at most `MOST_SIGHT_S` before an ego that drives on would hit them,
and for no less than an ego needs that brakes at once, as a full scan lets it: 0.2 s (two keyframes,
the second of which tells a velocity), 0.3 s until the brake acts and v / b to stand, of which it
drives half: 1.33 s of its way at 30 km/h and 0.9 s at the 4 m/s of a turn, with b = 5 m/s^2. So
nearly all can be prevented; and a second more is what sensing may lose.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from care_sim.core.frames import Pose
from care_sim.streets.furniture import CORNER_M
from care_sim.streets.layouts import EVEN_CHANCE, Curve, Range, Road, Side, draw
from care_sim.streets.sight import (
    EGO_LENGTH_M,
    EGO_WIDTH_M,
    Approach,
    Arrival,
    Line,
    Sight,
    sight_of,
)
from care_sim.world.bodies import CATALOGUE
from care_sim.world.motions import Walk

GAP_M: Range = (0.4, 0.8)
"""Between the occluder's end and who passes it: about half a step, as in the dart-out."""
AT_KERB = {
    "child": (("car", "van", "truck"), ("skip", "trailer", "hoarding")),
    "pedestrian": (("van", "truck", "bus"), ("trailer", "hoarding")),
}
"""Who comes out between what stands at the kerb: behind what perception reports, and behind what it
does not. A car or a skip is lower than an adult.
"""
AT_GARDEN = ("wall", "hedge", "hoarding")
AT_YARD = ("building",)
"""What stands between pavement and garden, and beside an entrance to a yard where the houses stand
at the pavement; perception reports none of it.
"""


@dataclass(frozen=True)
class Spot:
    """A part of the way where somebody may be met, `within_m` metres along `road`; the ego's place
    on its route is the road's and `offset_m`.

    On a side street `beside` is the side of the main road at which it begins. At a `corner` the ego
    has just turned into it.
    """

    road: Road
    within_m: Range
    offset_m: float = 0.0
    beside: Side | None = None
    corner: bool = False

    @property
    def along_m(self) -> Range:
        """From where to where it lies along the route."""
        return self.within_m[0] + self.offset_m, self.within_m[1] + self.offset_m


@dataclass(frozen=True)
class Hiding:
    """An `occluder` at a world `pose`. Who waits behind it comes out along the line across the road
    at `s`, and shows beyond `edge_m` from the road's reference line.
    """

    occluder: str
    pose: Pose
    s: float
    edge_m: float


def is_reported(occluder: str) -> bool:
    """Whether perception knows the class of a body of the catalogue."""
    return CATALOGUE[occluder].label is not None


def draw_hiding(rng: np.random.Generator, spot: Spot, side: Side, who: str) -> Hiding | None:
    """Somewhere to hide for `who` comes from a side of a spot's road; None where the drawn body may
    not stand.
    """
    at_kerb = who in AT_KERB and rng.random() < EVEN_CHANCE
    beyond = AT_GARDEN if side.garden_m else AT_YARD
    kinds = AT_KERB[who][int(rng.integers(2))] if at_kerb else beyond
    occluder = str(rng.choice(kinds))
    gap = CATALOGUE[who].size[1] / 2 + draw(rng, GAP_M)
    s = draw(rng, spot.within_m)
    length, width, _ = CATALOGUE[occluder].size
    if spot.corner and not at_kerb and rng.random() < EVEN_CHANCE:
        return _at_the_corner(spot, side, occluder, gap)
    middle_d, edge_d = _place(side, width, at_kerb)
    d = side.sign * middle_d
    # A metre along the line of a bend is shorter inside of it and longer outside. A straight body
    # reaches out into a bend whose inner side it stands on.
    curvature = spot.road.curve.curvature_at(s - length / 2)
    bulge = max(curvature * side.sign, 0.0) * (length / 2) ** 2 / 2
    middle = s - (gap + length / 2) / (1 - curvature * d)
    begins = middle - length / 2
    if at_kerb and edge_d - bulge < side.lane_edge_m:
        return None
    if spot.beside and at_kerb and begins < spot.beside.kerb_m + CORNER_M:
        return None
    if spot.beside and not at_kerb and begins < _plot_from(spot, side, width):
        return None
    x, y, heading = spot.road.curve.to_world(np.array([middle, d, 0.0])).tolist()
    return Hiding(occluder, (x, y, heading), s, edge_d)


def _at_the_corner(spot: Spot, side: Side, occluder: str, gap: float) -> Hiding:
    """Along the main road, where the plot at the corner begins, with its end at the side street."""
    length, width, _ = CATALOGUE[occluder].size
    begins = _plot_from(spot, side, length)
    place = np.array([begins + width / 2, side.sign * (side.boundary_m + length / 2), np.pi / 2])
    x, y, heading = spot.road.curve.to_world(place).tolist()
    return Hiding(occluder, (x, y, heading), begins + width + gap, side.boundary_m)


def _plot_from(spot: Spot, side: Side, depth: float) -> float:
    """Where along a side street the plot beside it begins, over a `depth` from its pavement on:
    behind the pavement of the main road, from which the side street may lead off askew.
    """
    assert spot.beside is not None
    edges = np.array([side.boundary_m, side.boundary_m + depth])
    road = np.column_stack([np.zeros(2), side.sign * edges, np.zeros(2)])
    off = spot.beside.sign * spot.road.curve.to_world(road)[:, 1]
    steep = abs(float(np.sin(spot.road.curve.start[2])))
    return float((spot.beside.boundary_m - off.min()) / steep)


def _place(side: Side, width: float, at_kerb: bool) -> tuple[float, float]:
    """How far from the reference line the middle of an occluder is, and its edge to the road."""
    if not at_kerb:
        return side.boundary_m + width / 2, side.boundary_m
    # What is wider than the parking lane stands to the kerb.
    middle = min(abs(side.parking_d), side.kerb_m - width / 2)
    return middle, middle - width / 2


MOST_SIGHT_S = 2.7
"""A car that comes from the left at 4 m/s across the narrowest street is in sight for 2.6 s."""
TRIES = 50
IMPACT_AT: Range = (0.25, 0.75)
"""Where along the ego's width, from the side from which they come, a conflict hits: the outer ones
of Euro NCAP's impact points.
"""
ENCROACHMENT_S: Range = (0.3, 1.0)
"""Post-encroachment time of a near miss (Allen, Shin and Cooper 1978): at least that of the
dart-out, at most the second below which encroachments count as critical (Peesapati, Hunter and
Rodgers 2018)."""
STOP_SHORT_M = 0.3
"""Who stops leaves this much to the lane, and to an ego that reaches out of it in a turn."""
HALF_BICYCLE_M = 0.84
"""The point that is hit lies half a length behind the front, of what is longer than a bicycle as
far behind as of one.
"""


class Course(StrEnum):
    """Course of an encounter if the ego drives on as it means to."""

    CONFLICT = "conflict"
    NEAR_MISS = "near-miss"
    STOP = "stop"


COURSES = {Course.CONFLICT: 0.5, Course.NEAR_MISS: 0.25, Course.STOP: 0.25}
"""Shares: braking for everybody must not pay, so half of all encounters need none."""


class Way(StrEnum):
    """How the ego's way runs while it sees who comes."""

    STRAIGHT = "straight"
    BEND = "bend"
    TURN = "turn"


@dataclass(frozen=True)
class Comer:
    """How somebody comes out: speed in m/s, and the metres in which it is reached, in the shade."""

    speed_mps: Range
    run_up_m: float


COMERS = {
    # From Euro NCAP's walk of 5 km/h to the run of the dart-out.
    "pedestrian": Comer((1.4, 2.8), 0.7),
    "child": Comer((1.4, 2.8), 0.7),
    # 10 to 15 km/h (Euro NCAP's cyclists who cross).
    "bicycle": Comer((2.8, 4.2), 3.0),
    # Out of a drive, at up to twice a walking pace.
    "car": Comer((2.0, 4.0), 3.0),
}


@dataclass(frozen=True)
class Wanted:
    """Which encounters are wanted: at most `most` in a drive, from 0 on; from the `side` +1 (left)
    or -1 (right); of `who`, one of `COMERS`; behind what perception reports, or does not. None
    stands for all.
    """

    most: int = 3
    side: int | None = None
    who: str | None = None
    reported: bool | None = None


ANYBODY = Wanted()


@dataclass(frozen=True)
class Encounter:
    """Somebody of the kind `who` waits behind an `occluder` at `occluder_pose`, beside `s` metres
    along the road's line, and comes from the `side` +1 (left) or -1 (right).

    `walk` is the way in the world, `from_d` where it begins in the road's d. The ego's middle is
    `arrival_m` along its route when its front is at `walk`'s line; `lead_s` is the ego's time until
    then at which `walk` begins.
    """

    who: str
    occluder: str
    occluder_pose: Pose
    course: Course
    curve: Curve
    s: float
    side: int
    from_d: float
    walk: Walk
    lead_s: float
    arrival_m: float
    sight: Sight
    way: Way

    @property
    def along_m(self) -> float:
        """Where on the route the line is."""
        return self.arrival_m + EGO_LENGTH_M / 2 + CATALOGUE[self.who].size[1] / 2

    @property
    def occluder_reported(self) -> bool:
        """Whether perception knows the occluder's class."""
        return is_reported(self.occluder)


def draw_encounter(
    rng: np.random.Generator, spot: Spot, approach: Approach, wanted: Wanted = ANYBODY
) -> Encounter | None:
    """A `wanted` encounter at a spot, redrawn until an ego on its `approach` sees who comes for as
    long as is stated; None where it never would after `TRIES`.
    """
    # The side is drawn once: redrawn, it would be the near one more often.
    side = spot.road.sides[int(rng.integers(2))]
    side = side if wanted.side is None else spot.road.side(wanted.side)
    for _ in range(TRIES):
        who = str(rng.choice(list(COMERS)))
        who = wanted.who or who
        hiding = draw_hiding(rng, spot, side, who)
        if hiding and wanted.reported not in (None, is_reported(hiding.occluder)):
            continue
        drawn = hiding and _coming_out(rng, spot, side, who, hiding, approach)
        if drawn and drawn.sight.spare_s >= 0 and drawn.sight.seconds <= MOST_SIGHT_S:
            return drawn
    return None


def _coming_out(
    rng: np.random.Generator,
    spot: Spot,
    side: Side,
    who: str,
    hiding: Hiding,
    approach: Approach,
) -> Encounter | None:
    """`who` comes out of hiding on some course; None without a way to stop on, or out of sight."""
    length, width, _ = CATALOGUE[who].size
    comer = COMERS[who]
    speed = draw(rng, comer.speed_mps)
    impact = EGO_WIDTH_M * (0.5 - draw(rng, IMPACT_AT))
    encroachment = draw(rng, ENCROACHMENT_S)
    course = Course(rng.choice(list(COURSES), p=list(COURSES.values())))
    x, y, heading = spot.road.curve.to_world(np.array([hiding.s, 0.0, 0.0])).tolist()
    line = Line((x, y, heading), side.sign)
    arrival = approach.arrival(line, width / 2)

    # All ways are of the middle, from its start behind the occluder's edge by the run-up.
    start = hiding.edge_m + comer.run_up_m + length / 2
    hit = start - arrival.at_m - impact - length / 2 + min(length / 2, HALF_BICYCLE_M)
    clear = start - arrival.reach_m[0] + length / 2
    way_m = _way_m(spot.road, side, who, start, course, arrival)
    if way_m <= 0:
        return None
    walk = Walk(
        line.point(0.0, start),
        heading - side.sign * np.pi / 2,
        speed,
        speed**2 / (2 * comer.run_up_m),
        way_m,
    )
    is_near_miss = course is Course.NEAR_MISS
    hit_s = walk.duration_to(hit)
    lead = walk.duration_to(clear) + encroachment if is_near_miss else hit_s
    sight = sight_of(approach, arrival, walk, length, hiding.occluder, hiding.pose, lead, hit_s)
    if sight is None:
        return None
    turning = Way.TURN if spot.beside else Way.BEND
    return Encounter(
        who, hiding.occluder, hiding.pose, course, spot.road.curve, hiding.s, side.sign,
        side.sign * start, walk, lead, arrival.place_m, sight,
        turning if sight.yaws else Way.STRAIGHT,
    )  # fmt: skip


def _way_m(
    road: Road, side: Side, who: str, start: float, course: Course, arrival: Arrival
) -> float:
    """How far somebody goes who waits `start` from the middle of the ego's lane: to the edge of the
    lanes, to the far pavement, or with a car into the drive beyond it.
    """
    length = CATALOGUE[who].size[0]
    if course is Course.STOP:
        edge = max(side.lane_edge_m, arrival.reach_m[1])
        return start - edge - STOP_SHORT_M - length / 2
    far = road.side(-side.sign)
    beyond = far.boundary_m + 1.0 if who == "car" else far.kerb_m + 0.3
    return start + length / 2 + beyond
