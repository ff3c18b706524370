"""The reward of the closed loop: named weights over metrics of a keyframe.

Each is at most 0, so that 0 is the best return there is.
"""

from collections.abc import Mapping
from typing import Any, TypeVar

from care_sim.base.checks import check_known, check_number
from care_sim.base.errors import InvalidInput, shown
from care_sim.core.arrays import Floats
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

HEAVIEST = 1e6
"""Returns stay small enough that sums of floats do not lose the other terms."""


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


def terms(record: Keyframe, in_view: bool, detected: bool, lost: float = 0.0) -> dict[str, float]:
    """The terms of one keyframe.

    `in_view` and `detected` say whether the first-sighting actor has been so by now, at least once;
    `lost` is what `Potential.advance` gives.

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
    closeness = 1.0 - min(max(record.clearance_m, 0.0), KEEP_CLEAR_M) / KEEP_CLEAR_M
    return {
        "delay": -1.0 if in_view and not detected else 0.0,
        "clearance": -closeness if in_view and closeness > 0 else 0.0,
        "collision": -1.0 if record.impact_speed_mps is not None else 0.0,
        "braking": -1.0 if record.braking and not in_view else 0.0,
        "gain": -lost,
    }


class Potential:
    """The share of the full-scan bound that is lost so far in an episode, as a potential.

    The bound is the distance at the first keyframe at which a scan of every cell would have
    detected the first-sighting actor. From then on, while it is undetected, 1 - distance / bound is
    lost, and at the end of an episode without a detection everything. The potential never falls,
    and `gain` is its difference from keyframe to keyframe (Ng, Harada and Russell 1999, with a
    discount of 1): the differences sum to the metric itself, however they are spread over the
    episode. A learner that discounts more weighs early losses more.
    """

    def __init__(self) -> None:
        self.bound_m: float | None = None
        self._lost = 0.0
        self._found = False

    def advance(self, record: Keyframe, detectable: bool, over: bool) -> float:
        """Go on by a keyframe, and say by how much the potential grows.

        `detectable` says whether a scan of every cell would detect the actor, `over` whether the
        episode ends with this keyframe.
        """
        before = self._lost
        if self.bound_m is None and (detectable or record.detected):
            self.bound_m = record.distance_m
        if self.bound_m is not None and not self._found:
            # A car that comes nearer loses more; one that moves away again wins nothing back.
            all_of_it = over and not record.detected
            self._lost = 1.0 if all_of_it else max(before, 1.0 - record.distance_m / self.bound_m)
        self._found |= record.detected
        return self._lost - before


class EpisodeReward:
    """The reward of one episode. `weights` holds one of every term."""

    def __init__(self, weights: Mapping[str, float]):
        self._weights = weights
        # Whether the first-sighting actor was in view or detected at any keyframe so far.
        self._in_view = False
        self._detected = False
        self._potential = Potential()

    @property
    def needs_bound(self) -> bool:
        """Whether the full-scan bound counts and is not known yet."""
        return bool(self._weights["gain"]) and self._potential.bound_m is None

    def of(self, record: Keyframe, detectable: bool, over: bool) -> tuple[float, dict[str, float]]:
        """The reward of the next keyframe, and its `terms`.

        `detectable` says whether a scan of every cell would detect the actor, where `needs_bound`
        asks for it; `over` whether the episode ends with this keyframe.
        """
        self._in_view |= record.in_view
        self._detected |= record.detected
        measured = bool(self._weights["gain"])
        lost = self._potential.advance(record, detectable, over) if measured else 0.0
        earned = terms(record, self._in_view, self._detected, lost)
        return weighted(self._weights, earned), earned


def weighted(weights: Mapping[str, float], earned: Mapping[str, _Number]) -> _Number:
    """The weighted sum of terms: numbers, or columns of numbers."""
    # Not `sum`, which adds floats in another way from Python 3.12 on.
    total: Any = 0.0
    for name, value in earned.items():
        total = total + weights[name] * value
    result: _Number = total
    return result
