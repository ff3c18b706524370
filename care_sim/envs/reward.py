"""The reward of the closed loop: named weights over metrics of a keyframe.

Each is at most 0, so that 0 is the best return there is.
"""

import math
from collections.abc import Mapping

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


BEGINNING = (0.0, 0.0, math.nan, 0.0)
"""State of the reward before the first keyframe of an episode. The first two numbers say whether
the first-sighting actor has been in view, and has been detected, at any keyframe. The third is the
full-scan bound, NaN until there is one. A scan of every cell would have detected the actor first at
this distance. The fourth is the share of the bound that is lost.
"""
BOUND = 2
"""The place of the full-scan bound in it."""


class Rewards:
    """The rewards of `worlds` worlds. `weights` holds one of every term.

    | term | of a keyframe | of an episode |
    |---|---|---|
    | `delay` | -1 while it has been in view and never detected | 0 down to -(keyframes in view) |
    | `clearance` | 0 at KEEP_CLEAR_M, -1 at contact, in view | 0 down to -(keyframes in view) |
    | `collision` | -1 at a contact with any body, which ends the episode | 0 or -1 |
    | `braking` | -1 while the brake is on before it is in view | 0 down to -(keyframes before) |
    | `gain` | -(share lost) | first-detection distance over the full-scan bound, less 1: 0 to -1 |

    Each is at most 0; with weights of 0 or more the best return is 0. A full scan can be late too,
    because the first rays that return lag behind the first pixels in view. Then `delay` stays below
    0, while `gain` reaches 0, except for faults of the LiDAR, which the bound ignores.

    From the bound on, while the actor is undetected, 1 - distance / bound is lost, and at the end
    of an episode without a detection everything. This potential never falls, and `gain` is its
    difference from keyframe to keyframe (Ng, Harada and Russell 1999, with a discount of 1). The
    differences sum to the metric itself, however they are spread over the episode. A learner that
    discounts more weighs early losses more.
    """

    def __init__(self, weights: Mapping[str, float], worlds: int):
        self._weights = weights
        self._measured = bool(weights["gain"])
        # (4, W) columns of `BEGINNING`.
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
        `need_bound` needs it; `over` (W,) whether the episode ends with this keyframe.
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
        # Not `sum`, which adds floats in another way from Python 3.12 on.
        total = np.zeros(len(who))
        for name, values in earned.items():
            total += self._weights[name] * values
        return total, earned


@compiled(brief=True)
def _earn(who: Mask, courses: Floats, told: Floats, measured: bool, table: Floats) -> None:
    """Fill the `table` (5, W) with the terms of the worlds `who`, in the order of `REWARD_WEIGHTS`,
    and lead their `courses` (4, W) on, each as `BEGINNING`.

    The first six rows of `told` (8, W) are as in `care_sim.loops.records.Records`: `in_view`,
    `detected`, `braking`, `distance_m`, `clearance_m` and `impact_speed_mps`. The last two say
    whether a scan of every cell would detect the actor, and whether the episode ends with this
    keyframe. `measured` says whether the bound, on which `gain` depends, is measured.
    """
    for w in range(len(who)):
        if not who[w]:
            continue
        course, now = courses[:, w], told[:, w]
        bound_m, lost = course[BOUND], course[3]
        distance_m, detectable, over = now[3], now[6] > 0, now[7] > 0
        if math.isnan(bound_m) and (detectable or now[1] > 0):
            bound_m = distance_m
        if not (math.isnan(bound_m) or course[1] > 0):
            # A car that comes nearer loses more; one that moves away again wins nothing back.
            gone = over and not now[1] > 0
            lost = 1.0 if gone else max(lost, 1.0 - distance_m / bound_m)
        in_view, detected = max(course[0], now[0]), max(course[1], now[1])
        closeness = 1.0 - min(max(now[4], 0.0), KEEP_CLEAR_M) / KEEP_CLEAR_M
        table[0, w] = -1.0 if in_view > 0 and not detected > 0 else 0.0
        table[1, w] = -closeness if in_view > 0 and closeness > 0 else 0.0
        table[2, w] = 0.0 if math.isnan(now[5]) else -1.0
        table[3, w] = -1.0 if now[2] > 0 and not in_view > 0 else 0.0
        table[4, w] = -(lost - course[3] if measured else 0.0)
        course[0], course[1], course[BOUND], course[3] = in_view, detected, bound_m, lost
