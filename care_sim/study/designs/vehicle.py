"""The vehicle study (paper, Sec. 5.5): late evidence in turns, a camera that fails during the
drive, and an inexact pose.
"""

from collections.abc import Iterator, Sequence
from itertools import product

from care_sim.base.errors import InvalidInput
from care_sim.core.forgetting import VEHICLE_SIGMA_M
from care_sim.scenarios.ncap.table import TESTS, AcrossExit
from care_sim.study.designs.variants import Group, Place, Variant
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.rows.parameters import Parameters


def _turning_tests() -> Iterator[Parameters]:
    """The Euro NCAP tests in which the ego turns, at every speed of the ego, each with the slowest
    target.
    """
    for name, test in TESTS.items():
        if isinstance(test.way, AcrossExit) or name == "CCFtap":
            slowest = min(each.target_kph for each in test.variations)
            for each in test.variations:
                if each.target_kph == slowest:
                    speeds = (("speed_kph", each.ego_kph), ("target_kph", each.target_kph))
                    yield (("test", name), *speeds)


TURNS = Group("NCAP turns, 1%", tuple(Place("ncap", 0.01, case) for case in _turning_tests()))
"""At 3% history avoids a third of them, at 1% next to none."""
DRIVES = Group("drives that turn off, 3%", (Place("drive", 0.03, (("turn_chance", 1.0),)),))
DENSE = Group("dense, 3%", (Place("dense", 0.03),))
DARTOUT = Group("dartout, 10%", (Place("dartout", 0.10),))

# The ages of the camera's evidence are those of the paper: 0.11 to 0.14 s on average, 0.42 s at the
# 95th percentile. The world's steps of 0.05 s make them 0.15 and 0.45 s.
EVIDENCE_LEVELS = (
    Variant("newest picture"),
    Variant("0.12 s late", {"camera_latency_s": 0.12}),
    Variant("0.42 s late", {"camera_latency_s": 0.42}),
    Variant("planned every 0.3 s", {"keyframe_s": 0.3}),
    Variant("planned every 0.3 s, 0.3 s late", {"keyframe_s": 0.3, "camera_latency": 1}),
)
"""The age of pictures and the keyframe rate."""
EVIDENCE_GROUPS = (TURNS, DRIVES)
EVIDENCE_POLICIES = ("care", "history", "full")
UNCOMPENSATED = {"yaw_compensation": False}
"""CARE with wedges that stay where they were in the picture."""


def _blackouts(start_s: float, length_s: float) -> tuple[Variant, ...]:
    times = f"away from {start_s:g} to {start_s + length_s:g} s"
    return (
        Variant("camera on"),
        Variant(times, {"blackout_start_s": start_s, "blackout_s": length_s}),
        Variant("away throughout", {"blackout_s": 3600.0}),
    )


# The person of the dense street and of the dart-out comes into view 2.4 to 2.9 s after the start.
BLACKOUTS = {
    DENSE: _blackouts(2.0, 1.0),
    DARTOUT: _blackouts(2.0, 1.0),
    DRIVES: _blackouts(10.0, 10.0),
}
FALLBACK_POLICIES = ("care", "all-camera", "history")
"""One policy without a camera, as the paper has it."""

POSE_LEVELS = (
    Variant("exact pose"),
    Variant("0.4 m, anew", {"ego_position_sigma_m": 0.4}),
    Variant("0.4 m, for 10 s", {"ego_position_sigma_m": 0.4, "ego_pose_correlation_s": 10.0}),
    # 10 m over 10^4 s: steps of 10 sqrt(2 t / 10^4) m, 0.14 m in a second.
    Variant("walk of 0.14 m", {"ego_position_sigma_m": 10.0, "ego_pose_correlation_s": 1e4}),
    Variant("1 degree, anew", {"ego_yaw_sigma_deg": 1.0}),
    Variant("1 degree, for 10 s", {"ego_yaw_sigma_deg": 1.0, "ego_pose_correlation_s": 10.0}),
)
"""The error of the pose: its spread, and how long it lasts."""
POSE_GROUPS = (DRIVES, DENSE)
POSE_POLICIES = ("care", "history")
FORGETTING = (
    Variant("sigma_pos 0", {}, {}, "care-sbf"),
    Variant("sigma_pos 0.4 m", {}, {"position_sigma_m": VEHICLE_SIGMA_M}, "care-sbf"),
)
"""CARE+SBF without and with the margin of the paper's vehicle."""


PLAYED_IN_PART = ("care-sbf", "full", "all-camera")
"""Policies that play only some of the questions."""


def uncompensated(level: Variant) -> Variant:
    """The level for CARE without compensation of the car's turn."""
    return Variant(level.label, level.changes, UNCOMPENSATED, "care")


def forgetting(level: Variant, rules: Variant) -> Variant:
    """The level for CARE+SBF with the rules of one of `FORGETTING`."""
    return Variant(level.label, level.changes, rules.parameters, rules.policy)


def is_late(level: Variant) -> bool:
    """Return True if the camera's evidence is old; otherwise there is nothing to compensate."""
    return not level.changes.keys().isdisjoint(("camera_latency", "camera_latency_s"))


def vehicle_study(seeds: Sequence[int], also: Sequence[str] = ()) -> list[EpisodeConfig]:
    """Every level of every question; `also` are further policies of all. Raises InvalidInput for
    one of `PLAYED_IN_PART`.
    """
    for policy in also:
        if policy in PLAYED_IN_PART:
            # Its rows would mix with those that the study plays of it, and be in no table.
            raise InvalidInput(
                f"the vehicle study plays {policy} itself where its tables show it; --also takes "
                f"any policy but {', '.join(PLAYED_IN_PART)}"
            )
    asked: list[tuple[Group, Variant, tuple[str, ...]]] = []
    for group, level in product(EVIDENCE_GROUPS, EVIDENCE_LEVELS):
        asked.append((group, level, (*EVIDENCE_POLICIES, *also)))
        if is_late(level):
            asked.append((group, uncompensated(level), ("care",)))
    for group, levels in BLACKOUTS.items():
        asked += [(group, level, (*FALLBACK_POLICIES, *also)) for level in levels]
    for group, level in product(POSE_GROUPS, POSE_LEVELS):
        asked.append((group, level, (*POSE_POLICIES, *also)))
        asked += [(group, forgetting(level, rules), ("care-sbf",)) for rules in FORGETTING]
    made = [
        config
        for group, level, policies in asked
        for place in group.places
        for config in level.configurations(place, policies, seeds)
    ]
    return [*dict.fromkeys(made)]
