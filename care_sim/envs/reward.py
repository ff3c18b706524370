"""The reward of the closed loop: named weights over metrics of a keyframe.

Each is at most 0, so that 0 is the best return there is.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from care_sim.base.checks import check_known, check_number
from care_sim.base.compiled import compiled
from care_sim.base.errors import InvalidInput, shown
from care_sim.core.arrays import Floats, Mask
from care_sim.core.defaults import HEAVIEST
from care_sim.loops.records import Records

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


Course = tuple[bool, bool, float, float]
"""What the reward remembers of an episode: whether the first-sighting actor has been in view and
detected at any keyframe; the full-scan bound, which is the distance at the first keyframe at which
a scan of every cell would have detected the actor, NaN while there was none; and the share of the
bound that is lost.
"""
Told = tuple[bool, bool, bool, float, float, float, bool, bool]
"""What the reward is told of a keyframe: `in_view`, `detected`, `braking`, `distance_m`,
`clearance_m` and `impact_speed_mps` as in `care_sim.loops.records.Records`; whether a scan of every
cell would detect the actor; and whether the episode ends with this keyframe.
"""
Terms = tuple[float, float, float, float, float]
BEGINNING: Course = (False, False, math.nan, 0.0)
"""Before the first keyframe."""
BOUND = 2
"""The place of the full-scan bound in a course."""


@compiled()
def terms(before: Course, told: Told, measured: bool) -> tuple[Course, Terms]:
    """The course after a keyframe, and the terms of the keyframe in the order of `REWARD_WEIGHTS`.
    `measured` says whether the bound is, on which `gain` stands.

    | term | of a keyframe | of an episode |
    |---|---|---|
    | `delay` | -1 while it has been in view and never detected | 0 down to -(keyframes in view) |
    | `clearance` | 0 at KEEP_CLEAR_M, -1 at contact, in view | 0 down to -(keyframes in view) |
    | `collision` | -1 at a contact with any body, which ends the episode | 0 or -1 |
    | `braking` | -1 while the brake is on before it is in view | 0 down to -(keyframes before) |
    | `gain` | -(share lost) | first-detection distance over the full-scan bound, less 1: 0 to -1 |

    Each is at most 0; with weights of 0 or more the best return is 0. Where a full scan too is
    late, as the first rays that return lag behind the first pixels in view, `delay` stays below 0;
    `gain` reaches 0 there, but for faults of the LiDAR, which the bound does not know.

    From the bound on, while the actor is undetected, 1 - distance / bound is lost, and at the end
    of an episode without a detection everything. This potential never falls, and `gain` is its
    difference from keyframe to keyframe (Ng, Harada and Russell 1999, with a discount of 1): the
    differences sum to the metric itself, however they are spread over the episode. A learner that
    discounts more weighs early losses more.
    """
    was_in_view, was_detected, bound_m, lost = before
    in_view, detected, braking, distance_m, clearance_m, impact_speed_mps, detectable, over = told
    if math.isnan(bound_m) and (detectable or detected):
        bound_m = distance_m
    if not (math.isnan(bound_m) or was_detected):
        # A car that comes nearer loses more; one that moves away again wins nothing back.
        lost = 1.0 if over and not detected else max(lost, 1.0 - distance_m / bound_m)
    in_view, detected = was_in_view or in_view, was_detected or detected
    closeness = 1.0 - min(max(clearance_m, 0.0), KEEP_CLEAR_M) / KEEP_CLEAR_M
    return (in_view, detected, bound_m, lost), (
        -1.0 if in_view and not detected else 0.0,
        -closeness if in_view and closeness > 0 else 0.0,
        0.0 if math.isnan(impact_speed_mps) else -1.0,
        -1.0 if braking and not in_view else 0.0,
        -(lost - before[3] if measured else 0.0),
    )


class Rewards:
    """The rewards of `worlds` worlds. `weights` holds one of every term."""

    def __init__(self, weights: Mapping[str, float], worlds: int):
        self._weights = weights
        self._measured = bool(weights["gain"])
        # (4, W) columns of `Course`.
        self._courses = np.full((worlds, len(BEGINNING)), BEGINNING, float).T.copy()

    def begin(self, world: int) -> None:
        """Begin an episode in a world."""
        self._courses[:, world] = BEGINNING

    @property
    def need_bound(self) -> Mask:
        """(W,) where the full-scan bound counts and is not known yet."""
        wanted: Mask = np.isnan(self._courses[BOUND]) & self._measured
        return wanted

    def of(
        self, records: Records, detectable: Mask, over: Mask, who: Mask
    ) -> tuple[Floats, dict[str, Floats]]:
        """The rewards (W,) of the next keyframe in the worlds `who`, 0 in the others, and their
        terms.

        `detectable` (W,) says whether a scan of every cell would detect the actor, where
        `need_bound` asks for it; `over` (W,) whether the episode ends with this keyframe.
        """
        table = np.zeros((len(REWARD_WEIGHTS), len(who)))
        told = np.array(
            [
                records.in_view,
                records.detected,
                records.braking,
                records.distance_m,
                records.clearance_m,
                records.impact_speed_mps,
                detectable,
                over,
            ]
        )
        _earn(who, self._courses, told, self._measured, table)
        earned = dict(zip(REWARD_WEIGHTS, table, strict=True))
        return weighted(self._weights, earned), earned


@compiled(brief=True)
def _earn(who: Mask, courses: Floats, told: Floats, measured: bool, table: Floats) -> None:
    """Fill the `table` (5, W) with the terms of the worlds `who`, and lead their `courses` (4, W)
    on; `told` (8, W) holds columns of `Told`.
    """
    for w in range(len(who)):
        if who[w]:
            before = courses[0, w] > 0, courses[1, w] > 0, courses[2, w], courses[3, w]
            now = (
                told[0, w] > 0,
                told[1, w] > 0,
                told[2, w] > 0,
                told[3, w],
                told[4, w],
                told[5, w],
                told[6, w] > 0,
                told[7, w] > 0,
            )
            after, values = terms(before, now, measured)
            courses[0, w], courses[1, w], courses[2, w], courses[3, w] = after
            for n in range(len(values)):
                table[n, w] = values[n]


def weighted(weights: Mapping[str, float], earned: Mapping[str, Floats]) -> Floats:
    """The weighted sum (W,) of columns of terms."""
    # Not `sum`, which adds floats in another way from Python 3.12 on.
    total: Any = 0.0
    for name, value in earned.items():
        total = total + weights[name] * value
    result: Floats = total
    return result
