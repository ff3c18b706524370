"""Who comes out into the ego's way in a drive: planned encounters, drawn from stated ranges.

Each has a line across the road, a body that hides who waits there, and an outcome for an ego that
drives on as it means to: a conflict, a near miss, or a stop at the edge of the carriageway. Who
waits sets off when the ego is a drawn time away, so that a conflict stays one after earlier
braking.

Who comes is in sight for `SIGHT_S` before an ego that drives on would hit them, reckoned from the
edge of what hides them. An ego that brakes at once, as a full scan lets it, needs 0.2 s (two
keyframes, the second of which tells a velocity), 0.3 s until the brake acts and v / b to stand, of
which it drives half: 1.2 s of its way at 25 km/h and 1.33 s at 30 km/h, with b = 5 m/s^2. Nobody is
in sight for less than the former, so that nearly all can be prevented; and a second more is what
sensing may lose.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from care_sim.streets.curve import Curve
from care_sim.streets.dimensions import Range, draw
from care_sim.streets.layouts import EVEN_CHANCE, Road, Side
from care_sim.world.bodies import CATALOGUE
from care_sim.world.walker import Walk

SIGHT_S: Range = (1.2, 2.5)
TRIES = 50
SHOWN_M = 0.3
"""Of who comes out, what must stick out for three returns at 15 m, where columns are 0.18 m apart.
"""
IMPACT_AT: Range = (0.25, 0.75)
"""Where along the ego's width, from the side from which they come, a conflict hits: the outer ones
of Euro NCAP's impact points.
"""
ENCROACHMENT_S: Range = (0.3, 1.0)
"""Post-encroachment time of a near miss (Allen, Shin and Cooper 1978): at least that of the
dart-out, at most the second below which encroachments count as critical (Peesapati, Hunter and
Rodgers 2018)."""
STOP_SHORT_M = 0.3
"""Who stops leaves this much to the lane."""
GAP_M: Range = (0.4, 0.8)
"""Between the occluder's end and who passes it: about half a step, as in the dart-out."""
EGO_WIDTH_M = CATALOGUE["ego"].size[1]
EGO_LENGTH_M = CATALOGUE["ego"].size[0]
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
class Encounter:
    """Somebody of the kind `who` waits behind an `occluder` at `occluder_pose`, beside `s` metres
    along the road's line, and comes from the `side` +1 (left) or -1 (right).

    `walk` is the way in the world, `from_d` where it begins in the road's d. `lead_s` is the ego's
    time to arrival with its front at `walk`'s line at which it begins.
    """

    who: str
    occluder: str
    occluder_pose: tuple[float, float, float]
    course: Course
    curve: Curve
    s: float
    side: int
    from_d: float
    walk: Walk
    lead_s: float
    sight_s: float

    @property
    def occluder_reported(self) -> bool:
        """Whether perception knows the occluder's class."""
        return CATALOGUE[self.occluder].label is not None

    @property
    def half_width(self) -> float:
        """Half of what it takes along the road."""
        return CATALOGUE[self.who].size[1] / 2


def draw_encounter(rng: np.random.Generator, road: Road, s: float) -> Encounter | None:
    """An encounter at `s` on a road from either side, redrawn until who comes is in sight for
    `SIGHT_S`; None where nobody would be after `TRIES`.
    """
    # The side is drawn once: redrawn, it would be the near one more often.
    side = road.sides[int(rng.integers(2))]
    for _ in range(TRIES):
        drawn = _drawn(rng, road, s, side)
        if SIGHT_S[0] <= drawn.sight_s <= SIGHT_S[1]:
            return drawn
    return None


def _drawn(rng: np.random.Generator, road: Road, s: float, side: Side) -> Encounter:
    who = str(rng.choice(list(COMERS)))
    at_kerb = who in AT_KERB and rng.random() < EVEN_CHANCE
    beyond = AT_GARDEN if side.garden_m else AT_YARD
    kinds = AT_KERB[who][int(rng.integers(2))] if at_kerb else beyond
    occluder = str(rng.choice(kinds))
    middle_d, edge_d = _place(side, occluder, at_kerb)
    length, width, _ = CATALOGUE[who].size
    gap = width / 2 + draw(rng, GAP_M)
    comer = COMERS[who]
    speed = draw(rng, comer.speed_mps)
    impact = EGO_WIDTH_M * (0.5 - draw(rng, IMPACT_AT))
    encroachment = draw(rng, ENCROACHMENT_S)
    course = Course(rng.choice(list(COURSES), p=list(COURSES.values())))

    # All ways are of the middle, from its start behind the occluder's edge by the run-up.
    start = edge_d + comer.run_up_m + length / 2
    hit = start - impact - length / 2 + min(length / 2, HALF_BICYCLE_M)
    clear = start + (EGO_WIDTH_M + length) / 2
    x, y, heading = road.curve.to_world(np.array([s, side.sign * start, 0.0])).tolist()
    walk = Walk(
        (x, y),
        heading - side.sign * np.pi / 2,
        speed,
        speed**2 / (2 * comer.run_up_m),
        _way_m(road, side, who, start, course),
    )
    is_near_miss = course is Course.NEAR_MISS
    lead = walk.duration_to(clear) + encroachment if is_near_miss else walk.duration_to(hit)
    occluder_s = s - gap - CATALOGUE[occluder].size[0] / 2
    pose = road.curve.to_world(np.array([occluder_s, side.sign * middle_d, 0.0])).tolist()
    sight = walk.duration_to(hit) - walk.duration_to(comer.run_up_m + SHOWN_M)
    return Encounter(
        who, occluder, tuple(pose), course, road.curve, s, side.sign,
        side.sign * start, walk, lead, sight,
    )  # fmt: skip


def _way_m(road: Road, side: Side, who: str, start: float, course: Course) -> float:
    """How far somebody goes who waits `start` from the middle of the ego's lane: to the edge of the
    lanes, to the far pavement, or with a car into the drive beyond it.
    """
    length = CATALOGUE[who].size[0]
    if course is Course.STOP:
        return start - side.lane_edge_m - STOP_SHORT_M - length / 2
    far = road.side(-side.sign)
    beyond = far.boundary_m + 1.0 if who == "car" else far.kerb_m + 0.3
    return start + length / 2 + beyond


def _place(side: Side, occluder: str, at_kerb: bool) -> tuple[float, float]:
    """How far from the reference line the middle of an occluder is, and its edge to the road."""
    width = CATALOGUE[occluder].size[1]
    if not at_kerb:
        return side.boundary_m + width / 2, side.boundary_m
    # What is wider than the parking lane stands to the kerb.
    middle = min(abs(side.parking_d), side.kerb_m - width / 2)
    return middle, middle - width / 2
