"""Episodes that are played together leave the rows that each leaves alone. Real episodes."""

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.study.episode_config import EpisodeConfig, grid, of_seeds
from care_sim.study.episode_play import play_episodes, play_together, run_episode
from care_sim.study.journal import JOURNAL, Journal
from care_sim.study.runner import run_all

MEASURED = {"wall_s", "peak_rss_mb"}
COLLISION = {
    "scenario_parameters": (("encroachment_s", (-0.2, -0.1)), ("ego_speed_mps", (12.0, 13.0)))
}
CASES = {
    "care": ("dense", "care", 0.1, {}),
    "history": ("dartout", "history", 0.03, {}),
    "full": ("cutin", "full", 1.0, {}),
    "a lane change": ("cutin", "random", 0.05, {}),
    "draws": ("r157", "care-spread", 0.02, {}),
    "hit": ("dartout", "history", 0.01, COLLISION),
    "its own memory": ("dense", "care-sightlines", 0.03, {}),
    "forgets": ("dense", "care-sbf", 0.1, {"false_negative_rate": 0.3, "camera_jitter": 1}),
    "learned": ("dense", "learned-scorer", 0.05, {"camera_latency": 2}),
    "told": ("dartout", "care-sector", 0.02, {"min_returns": 6, "cell_order": "core-spread"}),
    "parameters": ("dartout", "fan", 0.02, {"blackout_start_s": 1.0, "blackout_s": 2.0}),
    "unspent": ("dense", "all-camera", 0.3, {"floor": False}),
    "mirrored": ("dense", "history", 0.1, {"scenario_parameters": (("mirrored", "drawn"),)}),
    "coarse": ("dartout", "care", 0.1, {"keyframe_s": 0.2, "budget": 0.1}),
}


def steady(row):
    return {name: value for name, value in row.items() if name not in MEASURED}


def of(policy, seeds=3, scenario="dartout", **given):
    return of_seeds([EpisodeConfig(scenario, policy, **given)], range(seeds))


@pytest.mark.parametrize(("scenario", "policy", "budget", "given"), CASES.values(), ids=CASES)
def test_the_rows_are_those_of_the_same_episodes_alone(scenario, policy, budget, given):
    configs = of(policy, scenario=scenario, **{"budget": budget} | given)
    together, alone = play_together(configs), [run_episode(config) for config in configs]
    assert [*map(steady, together)] == [*map(steady, alone)]
    assert [[*row] for row in together] == [[*row] for row in alone]


def test_episodes_that_end_at_different_keyframes():
    configs = of("fan", 4, budget=0.001, **COLLISION)
    together = play_together(configs)
    assert len({row["keyframes"] for row in together}) > 1
    assert [*map(steady, together)] == [steady(run_episode(config)) for config in configs]


def test_each_has_an_even_share_of_the_time():
    rows = play_together(of("fan", scenario_parameters=(("duration_s", 0.3),)))
    assert len({row["wall_s"] for row in rows}) == 1
    assert 0 < rows[0]["wall_s"] < 60


@pytest.mark.parametrize(
    "alone",
    [
        EpisodeConfig("dartout", "history-oracle"),
        EpisodeConfig("dartout", "care", lidar_dropout=0.1),
        EpisodeConfig("drive", "care"),
    ],
)
def test_who_asks_for_truth_and_what_no_arrays_hold_is_played_alone(alone):
    assert alone.batch != alone.with_seed(1).batch
    together = EpisodeConfig("dartout", "care")
    assert together.batch == together.with_seed(1).batch


def test_one_that_fails_costs_only_itself(third_party):
    configs = of("raises-in-the-brake", 3, budget=0.03)
    endings = play_episodes(configs)
    reasons = {ending for ending in endings if isinstance(ending, str)}
    assert {reason.split(" (")[0] for reason in reasons} == {"RuntimeError: not in the brake"}
    rows = [ending for ending in endings if not isinstance(ending, str)]
    played = [c for c, ending in zip(configs, endings, strict=True) if not isinstance(ending, str)]
    assert 0 < len(rows) < 3
    assert [*map(steady, rows)] == [steady(run_episode(config)) for config in played]


def test_the_reasons_are_those_of_episodes_alone(third_party):
    short = {"scenario_parameters": (("duration_s", 0.3),)}
    for policy, reason in {
        "exits": "SystemExit: 4 (misbehaving.py, line 34)",
        "narrow": "action must have shape (32, 512) (rows, columns), got (1, 512)",
    }.items():
        assert play_episodes(of(policy, 2, **short)) == [reason] * 2


def test_a_policy_may_keep_what_it_is_shown_and_write_into_it(third_party):
    configs = of("keeps", scenario_parameters=(("duration_s", 1.0),))
    together = play_together(configs)
    assert [*map(steady, together)] == [steady(run_episode(config)) for config in configs]


def test_draws_that_a_process_shares_are_those_of_episodes_alone(third_party):
    configs = of("draws-in-common", 2, scenario_parameters=(("duration_s", 0.5),))
    for _ in range(2):
        with pytest.raises(InvalidInput, match="draws from a generator of the process"):
            play_together(configs)
    rows = play_episodes(configs)
    assert [*map(steady, rows)] == [steady(run_episode(config)) for config in configs]


def test_what_was_changed_later_is_not_taken_for_arrays():
    configs = [config.changed(engine="bullet") for config in of("history", 2)]
    with pytest.raises(InvalidInput, match="the engine is not played as arrays"):
        play_together(configs)


# Every death costs the start of a worker.
@pytest.mark.slow
def test_one_that_kills_its_worker_costs_only_itself(third_party, tmp_path):
    configs = grid(["dartout"], ["dies-in-the-brake"], [0.03], range(2))
    with Journal(tmp_path / JOURNAL) as journal:
        failures = run_all(configs, journal, 1)
        kept = {config for config in configs if config.key in journal}
    failed = {failure.config for failure in failures}
    assert {failure.reason for failure in failures} == {"the worker process died"}
    assert len(failed) == 1
    assert kept == {*configs} - failed
