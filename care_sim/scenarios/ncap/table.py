"""The numbers of the Euro NCAP tests: targets, ways, and obstructions.

Pedestrian and bicyclist tests are those of the AEB/LSS VRU protocol v4.5.1 (implementation 2023),
which names the tests and has the turning ones. Car tests are those of the Crash Avoidance Frontal
Collisions protocol v1.1 (implementation 2026), which has the crossing car. All numbers are from the
public OpenSCENARIO files of both (Vector Informatik, vectorgrp/OSC-NCAP-scenarios);
`tests/scenarios/test_ncap_files.py` compares them. Where the two years differ, pedestrians and
bicyclists follow 2023, which has steps of 5 km/h instead of 10.

Right-hand traffic: the near side is the ego's right. Metres, seconds, km/h where the protocols
speak of speeds.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Target:
    """The target that the ego meets.

    `body` is a kind of the catalogue. `point_m` is the distance of the impact point behind its
    centre, along its way.
    """

    body: str
    point_m: float


@dataclass(frozen=True)
class Across:
    """A straight way at right angles to the ego's.

    The target starts with its centre `start_m` from the middle of the ego's way. It gains its speed
    over the first `run_up_m`, or has it from the beginning, and keeps it. When the ego's front
    reaches the target's side, the impact point is at the share `overlap` of the ego's width. The
    share is counted from the target's side, which is the left for `far`.
    """

    start_m: float
    run_up_m: float
    overlap: float
    far: bool = False


@dataclass(frozen=True)
class Ahead:
    """The ego's own way, ahead of it.

    The target stands still, gains its speed over `run_up_m`, keeps it over `steady_m`, and is then
    reached; without a run-up it has its speed from the beginning. Its middle is in line with the
    share `overlap` of the ego's width, counted from the near side.
    """

    run_up_m: float
    steady_m: float
    overlap: float


@dataclass(frozen=True)
class BrakingAhead:
    """The ego's own way and speed, `headway_s` ahead of it, bumper to bumper. After `delay_s` the
    target brakes by `deceleration` m/s^2 down to `final_kph`.
    """

    headway_s: float
    delay_s: float
    deceleration: float
    final_kph: float


@dataclass(frozen=True)
class Bend:
    """The ego's way through a junction of two-lane roads, a quarter turn. It has a clothoid from a
    radius of 1,500 m down to `radius_m` that turns by `clothoid_deg`, an arc of `arc_deg`, and the
    clothoid back.
    """

    radius_m: float
    clothoid_deg: float
    arc_deg: float


@dataclass(frozen=True)
class AcrossExit:
    """The ego turns, to the left or the `right`. The target crosses the road that it turns into,
    `offset_m` from the middle line of the road that it comes from.

    The target's point starts `distance_m` from the middle of the ego's new lane. The target walks
    against the ego's first direction or `along` it, gains its speed over `run_up_m`, and is met by
    the middle of the ego's front. The ego has a bend for each of its speeds in km/h.
    """

    offset_m: float
    distance_m: float
    run_up_m: float
    right: bool
    along: bool
    bends: Mapping[float, Bend]


@dataclass(frozen=True)
class Oncoming:
    """The ego turns left. The target is oncoming in the next lane. When the ego's front reaches the
    target's side, the target's front is where the ego's way crosses the middle of that lane. The
    ego has a bend for each of its speeds in km/h.
    """

    bends: Mapping[float, Bend]


Way = Across | Ahead | BrakingAhead | AcrossExit | Oncoming


@dataclass(frozen=True)
class ParkedAlong:
    """Two cars parked beside the ego's way, the small one before the large one. `beside_m` is from
    the ego's side to the large one's. `gap_m` is between the two, and from the small one to the
    target's side.
    """

    beside_m: float
    gap_m: float


@dataclass(frozen=True)
class StandingAcross:
    """Two cars in line along the target's way, `before_m` before its side, seen from the ego. The
    large one is `end_m` from the middle of the ego's way, the small one `gap_m` behind it.
    """

    end_m: float
    before_m: float
    gap_m: float


@dataclass(frozen=True)
class WaitingBeside:
    """A large and two small cars in line along the ego's way, on the target's side, `gap_m` between
    them. The first one's bumper is `before_m` before the middle of the target's way. Their sides
    are `beside_m` from the middle of the ego's way.
    """

    before_m: float
    beside_m: float
    gap_m: float


Obstruction = ParkedAlong | StandingAcross | WaitingBeside


@dataclass(frozen=True)
class Variation:
    """A pair of speeds at which a test is run."""

    ego_kph: float
    target_kph: float


@dataclass(frozen=True)
class NcapTest:
    """A test: target, way, obstruction and speeds.

    The episode begins `start_s` before an ego that does not brake hits the target.
    """

    target: Target
    way: Way
    variations: tuple[Variation, ...]
    obstruction: Obstruction | None = None
    start_s: float = 4.0


# The hip point of a pedestrian dummy is 0.36 m behind its front, that of the child 0.396 m. The
# crank shaft of the bicycle is 0.62 m before its rear axle, its middle 0.605 m.
ADULT = Target("adult", 0.36 - 0.6 / 2)
CHILD = Target("child", 0.396 - 0.711 / 2)
BICYCLIST = Target("bicyclist", 0.605 - 0.62)
CAR = Target("target car", 0.0)
# A crossing car is hit a quarter of its length behind its front.
CROSSING_CAR = Target("target car", -4.023 / 4)

TURN_START_S = 8.0
"""A turn takes longer than a straight approach: at 10 km/h the bend alone is 7 s."""


def _each(ego_kph: Iterable[float], target_kph: float) -> tuple[Variation, ...]:
    return tuple(Variation(float(ego), target_kph) for ego in ego_kph)


_FROM_10 = range(10, 61, 5)
_FAST = range(50, 81, 5)
_LEFT_BENDS = {
    10.0: Bend(9.0, 20.62, 48.76),
    15.0: Bend(11.75, 20.93, 48.14),
    20.0: Bend(14.75, 21.79, 46.42),
}
_RIGHT_BENDS = {10.0: Bend(8.0, 22.85, 44.3)}


# From the rear axle's start, 7 m before the steady stretch, less the 0.62 m to the crank shaft.
_BICYCLE_RUN_UP_M = 7.0 - 0.62
_TO_MIDDLE_M = 7.0 - 0.605

_CROSSING_KPH = (20.0, 30.0, 40.0, 50.0, 60.0)
_CROSSING_PAIRS = tuple(Variation(a, b) for b in _CROSSING_KPH for a in _CROSSING_KPH)

TESTS: dict[str, NcapTest] = {
    "CPNCO-50": NcapTest(
        CHILD, Across(4.0, 1.0, 0.50), _each(_FROM_10, 5.0), ParkedAlong(beside_m=1.0, gap_m=1.0)
    ),
    "CPNA-25": NcapTest(ADULT, Across(4.0, 1.0, 0.25), _each(_FROM_10, 5.0)),
    "CPNA-75": NcapTest(ADULT, Across(4.0, 1.0, 0.75), _each(_FROM_10, 5.0)),
    "CPFA-50": NcapTest(ADULT, Across(6.0, 1.5, 0.50, far=True), _each(_FROM_10, 8.0)),
    "CPLA-25": NcapTest(ADULT, Ahead(1.0, 10.0, 0.25), _each(_FAST, 5.0)),
    "CPLA-50": NcapTest(ADULT, Ahead(1.0, 10.0, 0.50), _each(range(20, 61, 5), 5.0)),
    "CBNA-50": NcapTest(
        BICYCLIST,
        Across(17.0 + _TO_MIDDLE_M, _BICYCLE_RUN_UP_M, 0.50),
        _each(_FROM_10, 15.0),
        StandingAcross(end_m=17.0, before_m=1.0, gap_m=0.2),
    ),
    "CBNAO-50": NcapTest(
        BICYCLIST,
        Across(4.5 + _TO_MIDDLE_M, _BICYCLE_RUN_UP_M, 0.50),
        _each(_FROM_10, 10.0),
        StandingAcross(end_m=3.55, before_m=4.8, gap_m=0.2),
    ),
    "CBFA-50": NcapTest(
        BICYCLIST,
        Across(22.0 + _TO_MIDDLE_M, _BICYCLE_RUN_UP_M, 0.50, far=True),
        _each(_FROM_10, 20.0),
        StandingAcross(end_m=22.0, before_m=1.0, gap_m=0.2),
    ),
    "CBLA-25": NcapTest(BICYCLIST, Ahead(6.2, 28.0, 0.25), _each(_FAST, 20.0)),
    "CBLA-50": NcapTest(BICYCLIST, Ahead(3.5, 28.0, 0.50), _each(range(25, 61, 5), 15.0)),
    # Far side: a left turn, near side: a right turn; s walks in the ego's first direction, o
    # against it.
    "CPTAfs-50": NcapTest(
        ADULT,
        AcrossExit(9.5, 9.5, 2.0, right=False, along=True, bends=_LEFT_BENDS),
        _each(_LEFT_BENDS, 5.0),
        start_s=TURN_START_S,
    ),
    "CPTAfo-50": NcapTest(
        ADULT,
        AcrossExit(9.5, 6.0, 2.0, right=False, along=False, bends=_LEFT_BENDS),
        _each(_LEFT_BENDS, 5.0),
        start_s=TURN_START_S,
    ),
    "CPTAns-50": NcapTest(
        ADULT,
        AcrossExit(9.5, 6.0, 2.0, right=True, along=True, bends=_RIGHT_BENDS),
        _each(_RIGHT_BENDS, 5.0),
        start_s=TURN_START_S,
    ),
    "CPTAno-50": NcapTest(
        ADULT,
        AcrossExit(9.5, 9.5, 2.0, right=True, along=False, bends=_RIGHT_BENDS),
        _each(_RIGHT_BENDS, 5.0),
        start_s=TURN_START_S,
    ),
    "CCRs": NcapTest(CAR, Ahead(0.0, 0.0, 0.50), _each(range(10, 81, 10), 0.0)),
    "CCRm": NcapTest(
        CAR,
        Ahead(0.0, 0.0, 0.50),
        (
            *_each(range(30, 81, 10), 20.0),
            *(Variation(ego, ego - 60.0) for ego in (90.0, 100.0, 110.0, 120.0, 130.0)),
        ),
    ),
    "CCRb": NcapTest(
        CAR,
        BrakingAhead(headway_s=1.0, delay_s=3.0, deceleration=4.0, final_kph=2.0),
        tuple(Variation(float(kph), float(kph)) for kph in range(30, 81, 10)),
    ),
    "CCFtap": NcapTest(
        CAR,
        Oncoming(_LEFT_BENDS),
        tuple(Variation(ego, target) for target in (30.0, 45.0, 60.0) for ego in _LEFT_BENDS),
        start_s=TURN_START_S,
    ),
    "CCCscp-far": NcapTest(
        CROSSING_CAR,
        Across(0.0, 0.0, 0.50, far=True),
        _CROSSING_PAIRS,
        WaitingBeside(before_m=21.0, beside_m=5.5, gap_m=1.0),
    ),
    "CCCscp-near": NcapTest(
        CROSSING_CAR,
        Across(0.0, 0.0, 0.50),
        _CROSSING_PAIRS,
        WaitingBeside(before_m=24.0, beside_m=2.0, gap_m=1.0),
    ),
}
"""Every test by its name."""

SMALL_LENGTH_M, SMALL_WIDTH_M, SMALL_HEIGHT_M = (4.1, 4.4), (1.7, 1.9), 1.48
LARGE_LENGTH_M, LARGE_WIDTH_M, LARGE_HEIGHT_M = (4.3, 4.7), (1.75, 1.9), 1.533
"""Sizes of the cars that obstruct the view, from and to."""
