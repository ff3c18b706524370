"""The reward of the closed loop: named weights over metrics of a keyframe.

Each is at most 0, so that 0 is the best return there is.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple, TypeVar

from care_sim.base.checks import check_known, check_number
from care_sim.base.compiled import compiled
from care_sim.base.errors import InvalidInput, shown
from care_sim.core.arrays import Floats
from care_sim.core.defaults import HEAVIEST
from care_sim.loops.records import Keyframe

_Number = TypeVar("_Number", float, Floats)

KEEP_CLEAR_M = 2.0
"""Clearance below which it costs: the standstill distance s_0 of the controller."""

REWARD_WEIGHTS: dict[str, float] = {
    "delay": 1.0,
    "clearance": 1.0,
    "collision": 10.0,
    "braking": 0.1,
    "gain": 0.0,
}
"""Default weight of every term. `gain` is off, since the reward of these environments was published
without it. It is then not measured, which would cost rays, and reads 0."""


def weights(changes: Mapping[str, float] | None) -> dict[str, float]:
    """The default weights with some changed.

    Raises InvalidInput for an unknown term or no finite number.
    """
    changes = {} if changes is None else changes
    if not isinstance(changes, Mapping):
        raise InvalidInput(f"reward_weights must map terms to numbers, got {shown(changes)}")
    for name, value in changes.items():
        check_known("reward term", name, REWARD_WEIGHTS)
        check_number(f"reward weight {name}", value, -HEAVIEST, HEAVIEST)
    return {**REWARD_WEIGHTS, **{name: float(value) for name, value in changes.items()}}


class Course(NamedTuple):
    """What the reward remembers of an episode.

    `in_view` and `detected` say whether the first-sighting actor has been so at any keyframe.
    `bound_m` is the full-scan bound: the distance at the first keyframe at which a scan of every
    cell would have detected it, NaN while there was none. `lost` is the share of it that is lost.
    """

    in_view: bool
    detected: bool
    bound_m: float
    lost: float


class Told(NamedTuple):
    """What the reward is told of a keyframe: columns of `care_sim.loops.records.Records`;
    whether a scan of every cell would detect the actor, `detectable`; and whether the episode ends
    with this keyframe, `over`.
    """

    in_view: bool
    detected: bool
    braking: bool
    distance_m: float
    clearance_m: float
    impact_speed_mps: float
    detectable: bool
    over: bool


BEGINNING = (False, False, math.nan, 0.0)
"""The fields of `Course` before the first keyframe."""


# Plain tuples: from Python, named ones would take compiled code longer than the terms do.
@compiled()
def earned_at(
    before: tuple[bool, bool, float, float],
    told: tuple[bool, bool, bool, float, float, float, bool, bool],
    measured: bool,
) -> tuple[tuple[bool, bool, float, float], tuple[float, float, float, float, float]]:
    """The course after a keyframe and its `terms`, of the fields of the `Course` before it and of
    `Told`; `measured` says whether the bound is, on which `gain` stands.
    """
    now = Told(*told)
    course = _after(Course(*before), now)
    lost = course.lost - before[3] if measured else 0.0
    return (course.in_view, course.detected, course.bound_m, course.lost), terms(course, now, lost)


@compiled()
def terms(course: Course, now: Told, lost: float) -> tuple[float, float, float, float, float]:
    """The terms of one keyframe, in the order of `REWARD_WEIGHTS`.

    `course` is that after the keyframe, `lost` the share of the bound that was lost at it.

    | term | of a keyframe | of an episode |
    |---|---|---|
    | `delay` | -1 while it has been in view and never detected | 0 down to -(keyframes in view) |
    | `clearance` | 0 at KEEP_CLEAR_M, -1 at contact, in view | 0 down to -(keyframes in view) |
    | `collision` | -1 at a contact with any body, which ends the episode | 0 or -1 |
    | `braking` | -1 while the brake is on before it is in view | 0 down to -(keyframes before) |
    | `gain` | -`lost` | first-detection distance over the full-scan bound, less 1: 0 down to -1 |

    Each is at most 0; with weights of 0 or more the best return is 0. Where a full scan too is
    late, as the first rays that return lag behind the first pixels in view, `delay` stays below 0;
    `gain` reaches 0 there, but for faults of the LiDAR, which the bound does not know.
    """
    closeness = 1.0 - min(max(now.clearance_m, 0.0), KEEP_CLEAR_M) / KEEP_CLEAR_M
    return (
        -1.0 if course.in_view and not course.detected else 0.0,
        -closeness if course.in_view and closeness > 0 else 0.0,
        0.0 if math.isnan(now.impact_speed_mps) else -1.0,
        -1.0 if now.braking and not course.in_view else 0.0,
        -lost,
    )


@compiled()
def _after(course: Course, now: Told) -> Course:
    """The course after a keyframe.

    From the bound on, while the actor is undetected, 1 - distance / bound is lost, and at the end
    of an episode without a detection everything. This potential never falls, and `gain` is its
    difference from keyframe to keyframe (Ng, Harada and Russell 1999, with a discount of 1): the
    differences sum to the metric itself, however they are spread over the episode. A learner that
    discounts more weighs early losses more.
    """
    bound_m, lost = course.bound_m, course.lost
    if math.isnan(bound_m) and (now.detectable or now.detected):
        bound_m = now.distance_m
    if not (math.isnan(bound_m) or course.detected):
        # A car that comes nearer loses more; one that moves away again wins nothing back.
        all_of_it = now.over and not now.detected
        lost = 1.0 if all_of_it else max(lost, 1.0 - now.distance_m / bound_m)
    in_view, detected = course.in_view or now.in_view, course.detected or now.detected
    return Course(in_view, detected, bound_m, lost)


class EpisodeReward:
    """The reward of one episode. `weights` holds one of every term."""

    def __init__(self, weights: Mapping[str, float]):
        self._weights = weights
        self._measured = bool(weights["gain"])
        self._course = BEGINNING

    @property
    def needs_bound(self) -> bool:
        """Whether the full-scan bound counts and is not known yet."""
        return self._measured and math.isnan(Course(*self._course).bound_m)

    def of(self, record: Keyframe, detectable: bool, over: bool) -> tuple[float, dict[str, float]]:
        """The reward of the next keyframe, and its `terms`.

        `detectable` says whether a scan of every cell would detect the actor, where `needs_bound`
        asks for it; `over` whether the episode ends with this keyframe.
        """
        impact_speed_mps = record.impact_speed_mps
        told = (
            record.in_view,
            record.detected,
            record.braking,
            record.distance_m,
            record.clearance_m,
            math.nan if impact_speed_mps is None else impact_speed_mps,
            detectable,
            over,
        )
        self._course, values = earned_at(self._course, told, self._measured)
        earned = dict(zip(REWARD_WEIGHTS, values, strict=True))
        return weighted(self._weights, earned), earned


def weighted(weights: Mapping[str, float], earned: Mapping[str, _Number]) -> _Number:
    """The weighted sum of terms: numbers, or columns of numbers."""
    # Not `sum`, which adds floats in another way from Python 3.12 on.
    total: Any = 0.0
    for name, value in earned.items():
        total = total + weights[name] * value
    result: _Number = total
    return result
