"""The vehicle study: its design, and what its episodes note."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.study.designs.vehicle import (
    BLACKOUTS,
    DENSE,
    EVIDENCE_LEVELS,
    FORGETTING,
    POSE_LEVELS,
    TURNS,
    forgetting,
    is_late,
    uncompensated,
    vehicle_study,
)
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.episode_play import run_episode
from care_sim.study.rows.reading import key_of
from care_sim.study.vehicle_play import vehicle_row

SHORT = (("duration_s", 4.0),)
DENSE_CARE = EpisodeConfig("dense", "care", 0.03, scenario_parameters=SHORT)
TURN = EpisodeConfig(
    "ncap", "care", 0.01, camera_latency=4, scenario_parameters=TURNS.places[0].parameters
)


@pytest.fixture(scope="module")
def dark():
    """The camera is away from 2 to 3 s."""
    return vehicle_row(replace(DENSE_CARE, blackout_start_s=2.0, blackout_s=1.0))


@pytest.fixture(scope="module")
def turn():
    return vehicle_row(TURN)


def test_every_level_of_every_question_is_played_once():
    configs = vehicle_study([0, 1], ["fan"])
    assert len(configs) == len(set(configs))
    played = Counter((config.policy, config.scenario) for config in configs)
    late = sum(map(is_late, EVIDENCE_LEVELS))
    # The full scan feels the period of a keyframe and no camera.
    assert played["full", "ncap"] == 2 * 2 * len(TURNS.places)
    assert played["history", "ncap"] == 2 * len(EVIDENCE_LEVELS) * len(TURNS.places)
    assert played["care", "ncap"] == 2 * (len(EVIDENCE_LEVELS) + late) * len(TURNS.places)
    assert played["care-sbf", "dense"] == 2 * len(FORGETTING) * len(POSE_LEVELS)
    assert {config.policy for config in configs if config.scenario == "dartout"} == {
        "care",
        "all-camera",
        "history",
        "fan",
    }


@pytest.mark.parametrize("policy", ["care-sbf", "full", "all-camera"])
def test_a_policy_of_some_questions_cannot_join_in(policy):
    """Its rows of the other questions would stand in no table."""
    with pytest.raises(InvalidInput, match=f"plays {policy} itself .* any policy but care-sbf"):
        vehicle_study([0], ["fan", policy])


def test_late_levels_have_the_ages_of_the_paper():
    late = [level for level in EVIDENCE_LEVELS if is_late(level)]
    assert [level.label for level in EVIDENCE_LEVELS if "late" in level.label] == [
        level.label for level in late
    ]
    assert [level.changes.get("camera_latency_s") for level in late] == [0.12, 0.42, None]
    place = TURNS.places[0]
    for level in late:
        for one in (level, uncompensated(level)):
            (config,) = one.configurations(place, ["care"], [0])
            assert key_of(config.row() | {"tags": "causal"}) == one.key(place, "care")


def test_ages_in_seconds_are_rounded_up_to_steps_of_the_world():
    late = vehicle_row(replace(DENSE_CARE, camera_latency_s=0.12))
    assert set(late["evidence_ages_ms"]) == {150}


def test_the_turning_tests_are_those_in_which_the_ego_turns():
    tests = Counter(dict(place.parameters)["test"] for place in TURNS.places)
    assert tests == {"CPTAfs-50": 3, "CPTAfo-50": 3, "CPTAns-50": 1, "CPTAno-50": 1, "CCFtap": 3}


def test_a_level_finds_the_rows_that_it_plays():
    """With the parameters of the policy and of the place, after a change of each."""
    (place,) = DENSE.places
    level = next(level for level in POSE_LEVELS if level.changes)
    for one in (level, uncompensated(level), *(forgetting(level, rules) for rules in FORGETTING)):
        (config,) = one.configurations(place, ["care"], [0])
        row = config.row() | {"tags": "causal"}
        assert one.key(place, "care")[0].conditions

        assert key_of(row) == one.key(place, "care")
    turn = TURNS.places[0]
    (config,) = EVIDENCE_LEVELS[-1].configurations(turn, ["care"], [0])
    assert config.keyframe_s == 0.3


def test_the_watch_leaves_the_episode_as_it_is(turn):
    plain = run_episode(TURN)
    assert turn["episode_hash"] == plain["episode_hash"]
    assert {name: turn[name] for name in plain if name not in ("wall_s", "peak_rss_mb")} == {
        name: plain[name] for name in plain if name not in ("wall_s", "peak_rss_mb")
    }


def test_without_a_camera_the_three_policies_are_one(dark):
    # 10 keyframes of 0.1 s; when the camera is back, they differ at once: it shows the tracked
    # vehicles, for which all-camera reserves.
    assert (dark["dark_keyframes"], dark["dark_alike"]) == (10, 10)
    assert set(dark["dark_entries_alike"]) <= {1}
    assert dark["apart_after_s"] == pytest.approx(0.0)
    on = vehicle_row(DENSE_CARE)
    assert (on["dark_keyframes"], on["apart_after_s"]) == (0, None)


def test_late_pictures_still_count_in_a_blackout():
    """With evidence 0.3 s late, the first three keyframes of it are not dark, and the three after
    it are.
    """
    late = vehicle_row(replace(DENSE_CARE, blackout_start_s=2.0, blackout_s=1.0, camera_latency=3))
    assert late["dark_keyframes"] == 7
    assert late["apart_after_s"] == pytest.approx(0.3)


def test_compensation_keeps_late_wedges_on_their_bodies_in_a_turn(turn):
    assert set(turn["evidence_ages_ms"]) == {400}
    assert turn["boxes"] >= turn["turned_boxes"] > 0
    assert turn["turned_held"] > 1.3 * turn["unturned_held"]


def test_straight_ahead_no_box_is_turned(dark):
    assert dark["boxes"] > 100
    assert dark["turned_boxes"] == dark["turned_held"] == dark["unturned_held"] == 0


def test_an_exact_pose_forecasts_what_stands_exactly_and_jumps_do_not(dark):
    jumps = vehicle_row(replace(DENSE_CARE, ego_position_sigma_m=0.4))
    assert dark["forecast_error_m"] < 0.05
    assert jumps["forecast_error_m"] > 1.0
    assert dark["forecasts_in_eq4"] > 0.95 * dark["forecasts"]
    assert jumps["forecasts_in_eq4"] < 0.6 * jumps["forecasts"]
    assert jumps["forecasts"] > 0


def test_the_margin_of_eq_4_holds_no_more_than_a_full_hull():
    """As in the policy, which never widens a hull."""
    drift = vehicle_row(replace(DENSE_CARE, ego_position_sigma_m=0.4, ego_pose_correlation_s=10.0))
    assert 0 < drift["forecasts_in_eq4"] <= drift["forecasts_in_margin"] < drift["forecasts"]


def test_the_guard_of_a_standing_car_is_four_metres():
    """The paper's k_safe s_0; a car whose brake comes on for nearly anything soon stands."""
    row = vehicle_row(replace(DENSE_CARE, policy="full", budget=1.0, brake_side_margin_m=5.0))
    assert row["standing_keyframes"] > 0
    assert row["standing_guard_least_m"] == row["standing_guard_most_m"] == 4.0


def test_the_margin_of_eq_4_keeps_cells_that_forgetting_would_release(dark):
    assert 0 < dark["released_cells_vehicle"] < dark["released_cells"]


def test_blackouts_begin_and_end_as_their_labels_say():
    for levels in BLACKOUTS.values():
        on, away, throughout = levels
        assert not on.changes
        start, length = (away.changes[name] for name in ("blackout_start_s", "blackout_s"))
        assert away.label == f"away from {start:g} to {start + length:g} s"
        assert throughout.changes["blackout_s"] == np.float64(3600.0)
