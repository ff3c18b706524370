"""The reward: named weights over metrics of a keyframe, each at most 0."""

from collections.abc import Mapping

from care_sim.errors import check_number, unknown
from care_sim.types import Keyframe

KEEP_CLEAR_M = 2.0
"""Clearance below which it costs: the standstill distance s_0 of the controller."""

WEIGHTS: dict[str, float] = {"delay": 1.0, "clearance": 1.0, "collision": 10.0, "braking": 0.1}
"""Default weight of every term."""


def weights(changes: Mapping[str, float] | None) -> dict[str, float]:
    """The default weights with some changed. Raises InvalidInput for an unknown term or no finite number."""
    changes = changes or {}
    for name, value in changes.items():
        if name not in WEIGHTS:
            raise unknown("reward term", name, WEIGHTS)
        check_number(f"reward weight {name}", value)
    return {**WEIGHTS, **changes}


def terms(frame: Keyframe, in_view: bool, detected: bool) -> dict[str, float]:
    """The terms of one keyframe.

    `in_view` and `detected` say whether the first-sighting actor has been so by now, at least once.

    - `delay`: -1 while it has come into view and was never detected.
    - `clearance`: from 0 at KEEP_CLEAR_M to -1 at contact with it, once in view.
    - `collision`: -1 at a contact with any body.
    - `braking`: -1 while the brake is on before it has come into view (needless).

    Each is at most 0; the best episode has reward 0.
    """
    closeness = 1.0 - min(max(frame.clearance_m, 0.0), KEEP_CLEAR_M) / KEEP_CLEAR_M
    return {
        "delay": -1.0 if in_view and not detected else 0.0,
        "clearance": -closeness if in_view and closeness > 0 else 0.0,
        "collision": -1.0 if frame.impact_speed_mps is not None else 0.0,
        "braking": -1.0 if frame.braking and not in_view else 0.0,
    }
