"""Encounters in a drive: people and vehicles that come out into the ego's way, drawn from stated
ranges.

Each encounter has a line across the road, a body that hides the waiting comer, and a result for an
ego that drives on as planned. Results are a conflict, a near miss, or a stop at the edge of the
carriageway. The comer sets off when the ego is a drawn time away, so that a conflict stays one
after earlier braking.

Everything is computed along the ego's planned way, with its speeds, bends and turns. A comer is in
sight for at most `MOST_SIGHT_S` before an ego that drives on would hit the comer. It is in sight at
least as long as an ego with a full scan needs to brake. That is 0.2 s (two keyframes, the second of
which gives a velocity), 0.3 s until the brake acts, and half of v / b. With b = 5 m/s^2 this is
1.33 s at 30 km/h and 0.9 s at the 4 m/s of a turn. So nearly all conflicts can be prevented, and
sensing may lose up to a second.
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
"""Gap between the occluder's end and a comer: about half a step, as in the dart-out."""
AT_KERB = {
    "child": (("car", "van", "truck"), ("skip", "trailer", "hoarding")),
    "pedestrian": (("van", "truck", "bus"), ("trailer", "hoarding")),
}
"""Comers between bodies at the kerb: behind reported occluders, and behind unreported ones. A car
or a skip is lower than an adult.
"""
AT_GARDEN = ("wall", "hedge", "hoarding")
AT_YARD = ("building",)
"""Occluders between pavement and garden, and beside an entrance to a yard if houses are at the
pavement; perception reports none of them.
"""


@dataclass(frozen=True)
class Spot:
    """A part of the way for an encounter, `within_m` metres along `road`. The ego's place on its
    route is the road's plus `offset_m`.

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
        """Return its begin and end along the route."""
        return self.within_m[0] + self.offset_m, self.within_m[1] + self.offset_m


@dataclass(frozen=True)
class Hiding:
    """An `occluder` at a world `pose`. The comer behind it comes out along the line across the road
    at `s`, and is visible beyond `edge_m` from the road's reference line.
    """

    occluder: str
    pose: Pose
    s: float
    edge_m: float


def is_reported(occluder: str) -> bool:
    """Return True if perception knows the class of a catalogue body."""
    return CATALOGUE[occluder].label is not None


def draw_hiding(rng: np.random.Generator, spot: Spot, side: Side, who: str) -> Hiding | None:
    """Draw a hiding place for `who`, on a side of a spot's road; None if the drawn body may not
    stand there.
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
    """Return the place along the main road of the plot at the corner, with its end at the side
    street.
    """
    length, width, _ = CATALOGUE[occluder].size
    begins = _plot_from(spot, side, length)
    place = np.array([begins + width / 2, side.sign * (side.boundary_m + length / 2), np.pi / 2])
    x, y, heading = spot.road.curve.to_world(place).tolist()
    return Hiding(occluder, (x, y, heading), begins + width + gap, side.boundary_m)


def _plot_from(spot: Spot, side: Side, depth: float) -> float:
    """Return where along a side street the plot beside it begins, over a `depth` from its pavement.
    It is behind the main road's pavement, which may be at an oblique angle.
    """
    assert spot.beside is not None
    edges = np.array([side.boundary_m, side.boundary_m + depth])
    road = np.column_stack([np.zeros(2), side.sign * edges, np.zeros(2)])
    off = spot.beside.sign * spot.road.curve.to_world(road)[:, 1]
    steep = abs(float(np.sin(spot.road.curve.start[2])))
    return float((spot.beside.boundary_m - off.min()) / steep)


def _place(side: Side, width: float, at_kerb: bool) -> tuple[float, float]:
    """Return the distances of an occluder's middle and of its edge to the road from the reference
    line.
    """
    if not at_kerb:
        return side.boundary_m + width / 2, side.boundary_m
    # Bodies wider than the parking lane stand at the kerb.
    middle = min(abs(side.parking_d), side.kerb_m - width / 2)
    return middle, middle - width / 2


MOST_SIGHT_S = 2.7
"""A car that comes from the left at 4 m/s across the narrowest street is in sight for 2.6 s."""
TRIES = 50
IMPACT_AT: Range = (0.25, 0.75)
"""Impact points of a conflict along the ego's width, from the comer's side: the outer ones of Euro
NCAP.
"""
ENCROACHMENT_S: Range = (0.3, 1.0)
"""Post-encroachment time of a near miss (Allen, Shin and Cooper 1978). At least that of the
dart-out, at most 1 s, below which encroachments count as critical (Peesapati, Hunter and Rodgers
2018).
"""
STOP_SHORT_M = 0.3
"""Distance of a stopping comer from the lane, and from an ego that reaches out of it in a turn."""
HALF_BICYCLE_M = 0.84
"""The impact point is half a length behind the front; for bodies longer than a bicycle, half a
bicycle's length.
"""


class Course(StrEnum):
    """Course of an encounter if the ego drives on as planned."""

    CONFLICT = "conflict"
    NEAR_MISS = "near-miss"
    STOP = "stop"


COURSES = {Course.CONFLICT: 0.5, Course.NEAR_MISS: 0.25, Course.STOP: 0.25}
"""Shares of the courses. Braking for everybody must not pay, so half of all encounters need no
braking.
"""


class Way(StrEnum):
    """Shape of the ego's way while it sees the comer."""

    STRAIGHT = "straight"
    BEND = "bend"
    TURN = "turn"


@dataclass(frozen=True)
class Comer:
    """Motion of a comer: speed in m/s, and the metres in which it is reached, while hidden."""

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
    """Filter of encounters: at most `most` per drive, from 0 on; from the `side` +1 (left) or -1
    (right); of `who`, one of `COMERS`; behind reported or unreported occluders. None stands for
    all.
    """

    most: int = 3
    side: int | None = None
    who: str | None = None
    reported: bool | None = None


ANYBODY = Wanted()


@dataclass(frozen=True)
class Encounter:
    """A comer of the kind `who` waits behind an `occluder` at `occluder_pose`, `s` metres along the
    road's line, on the `side` +1 (left) or -1 (right).

    `walk` is the way in the world, `from_d` its begin in the road's d. The ego's middle is
    `arrival_m` along its route when its front is at `walk`'s line. `walk` begins when the ego needs
    `lead_s` more until then.
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
        """Place of the line on the route."""
        return self.arrival_m + EGO_LENGTH_M / 2 + CATALOGUE[self.who].size[1] / 2

    @property
    def occluder_reported(self) -> bool:
        """True if perception knows the occluder's class."""
        return is_reported(self.occluder)


def draw_encounter(
    rng: np.random.Generator, spot: Spot, approach: Approach, wanted: Wanted = ANYBODY
) -> Encounter | None:
    """Draw a `wanted` encounter at a spot, again until an ego on its `approach` sees the comer for
    the stated time; None after `TRIES`.
    """
    # The side is drawn once: redrawing would favour the near one.
    side = spot.road.sides[int(rng.integers(2))]
    side = side if wanted.side is None else spot.road.side(wanted.side)
    for _ in range(TRIES):
        who = str(rng.choice(list(COMERS)))
        who = wanted.who or who
        hiding = draw_hiding(rng, spot, side, who)
        if hiding and wanted.reported not in (None, is_reported(hiding.occluder)):
            continue
        drawn = hiding and _draw_course(rng, spot, side, who, hiding, approach)
        if drawn and drawn.sight.spare_s >= 0 and drawn.sight.seconds <= MOST_SIGHT_S:
            return drawn
    return None


def _draw_course(
    rng: np.random.Generator,
    spot: Spot,
    side: Side,
    who: str,
    hiding: Hiding,
    approach: Approach,
) -> Encounter | None:
    """Draw the course of `who` out of hiding; None without a place to stop, or out of sight."""
    length, width, _ = CATALOGUE[who].size
    comer = COMERS[who]
    speed = draw(rng, comer.speed_mps)
    impact = EGO_WIDTH_M * (0.5 - draw(rng, IMPACT_AT))
    encroachment = draw(rng, ENCROACHMENT_S)
    course = Course(rng.choice(list(COURSES), p=list(COURSES.values())))
    x, y, heading = spot.road.curve.to_world(np.array([hiding.s, 0.0, 0.0])).tolist()
    line = Line((x, y, heading), side.sign)
    arrival = approach.arrival(line, width / 2)

    # Ways are those of the comer's middle, which starts behind the occluder's edge by the run-up.
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
    """Return the length of a comer's way that begins `start` from the middle of the ego's lane. It
    ends at the edge of the lanes, at the far pavement, or, for a car, in the drive beyond.
    """
    length = CATALOGUE[who].size[0]
    if course is Course.STOP:
        edge = max(side.lane_edge_m, arrival.reach_m[1])
        return start - edge - STOP_SHORT_M - length / 2
    far = road.side(-side.sign)
    beyond = far.boundary_m + 1.0 if who == "car" else far.kerb_m + 0.3
    return start + length / 2 + beyond
