"""The reward: named weights over metrics of a keyframe, each at most 0."""

from collections.abc import Mapping

from care_sim.errors import unknown
from care_sim.types import Keyframe

KEEP_CLEAR_M = 2.0
"""Clearance below which it costs: the standstill distance s_0 of the controller."""

WEIGHTS: dict[str, float] = {"delay": 1.0, "clearance": 1.0, "collision": 10.0, "braking": 0.1}
"""Default weight of every term."""


def weights(changes: Mapping[str, float] | None) -> dict[str, float]:
    """The default weights with some changed. Raises InvalidInput for an unknown term."""
    for name in changes or {}:
        if name not in WEIGHTS:
            raise unknown("reward term", name, WEIGHTS)
    return {**WEIGHTS, **(changes or {})}


def terms(frame: Keyframe, in_view_before: bool, detected_before: bool) -> dict[str, float]:
    """The terms of one keyframe.

    - `delay`: -1 while the first-sighting actor has come into view and was never detected.
    - `clearance`: from 0 at KEEP_CLEAR_M to -1 at contact with it, once in view.
    - `collision`: -1 at a contact with any body.
    - `braking`: -1 while the brake is on before the actor has come into view (needless).

    Each is at most 0; the best episode has reward 0.
    """
    in_view = in_view_before or frame.in_view
    detected = detected_before or frame.detected
    closeness = 1.0 - min(max(frame.clearance_m, 0.0), KEEP_CLEAR_M) / KEEP_CLEAR_M
    return {
        "delay": -float(in_view and not detected),
        "clearance": -closeness if in_view else 0.0,
        "collision": -float(frame.impact_speed_mps is not None),
        "braking": -float(frame.braking and not in_view),
    }
