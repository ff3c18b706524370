"""What a Euro NCAP test is made of: who is met, on which way, and behind what.

Right-hand traffic: the near side is the ego's right. Metres, seconds, km/h where the protocols
speak of speeds.
"""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Target:
    """Whom the ego meets.

    `body` is a kind of the catalogue. `point_m` is how far behind its centre, seen along its way,
    the point lies that the ego's front is to meet.
    """

    body: str
    point_m: float


@dataclass(frozen=True)
class Across:
    """A straight way at right angles to the ego's.

    The target stands with its centre `start_m` from the middle of the ego's way, gains its speed
    over the first `run_up_m` and keeps it; without a run-up it has its speed from the beginning.
    Its point is in line with the share `overlap` of the ego's width when the ego's front comes to
    its side. The share is counted from the side that the target comes from, which is the left one
    where it is the `far` side.
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
    """The ego's way through a junction of two-lane roads, a quarter turn: a clothoid from a radius
    of 1,500 m down to `radius_m` that turns by `clothoid_deg`, an arc of `arc_deg`, and the
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
    """The ego turns left. The target comes towards it in the lane beside, and its front is where
    the ego's way crosses the middle of that lane as the ego's front comes up to its side. The ego
    has a bend for each of its speeds in km/h.
    """

    bends: Mapping[float, Bend]


Way = Across | Ahead | BrakingAhead | AcrossExit | Oncoming


@dataclass(frozen=True)
class ParkedAlong:
    """Two cars parked beside the ego's way, the small one before the large one: `beside_m` from the
    ego's side to the large one's, `gap_m` between the two, and from the small one to the target's
    side.
    """

    beside_m: float
    gap_m: float


@dataclass(frozen=True)
class StandingAcross:
    """Two cars that stand in line along the target's way, `before_m` before its side, seen from the
    ego: the large one `end_m` from the middle of the ego's way, the small one `gap_m` behind it.
    """

    end_m: float
    before_m: float
    gap_m: float


@dataclass(frozen=True)
class WaitingBeside:
    """A large and two small cars that stand in line along the ego's way, on the target's side,
    `gap_m` between them: the first one's bumper `before_m` before the middle of the target's way,
    their sides `beside_m` from the middle of the ego's.
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
    """A test: whom the ego meets, on which way, behind what, and at which speeds.

    The episode begins `start_s` before an ego that does not brake hits the target.
    """

    target: Target
    way: Way
    variations: tuple[Variation, ...]
    obstruction: Obstruction | None = None
    start_s: float = 4.0
