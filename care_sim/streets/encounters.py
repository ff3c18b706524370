"""Who comes out into the ego's way in a drive: planned encounters, drawn from stated ranges.

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
from care_sim.streets.approach import EGO_LENGTH_M, EGO_WIDTH_M, Approach, Arrival, Line
from care_sim.streets.curve import Curve
from care_sim.streets.dimensions import Range, draw
from care_sim.streets.hiding import Hiding, Spot, draw_hiding, is_reported
from care_sim.streets.layouts import Road, Side
from care_sim.streets.sight import Sight, sight_of
from care_sim.world.bodies import CATALOGUE
from care_sim.world.motions import Walk

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
    """What comes of an encounter if the ego drives on as it means to."""

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
