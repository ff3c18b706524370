"""Episodes that are played together leave the rows that each leaves alone. Real episodes."""

import hashlib
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import care_sim  # noqa: F401 (registers the environments)
from care_sim.base.digests import portable_bytes
from care_sim.base.errors import InvalidInput
from care_sim.scenarios.ncap.table import TESTS
from care_sim.study.episode_config import EpisodeConfig, grid, of_seeds
from care_sim.study.episode_play import (
    EpisodeHash,
    peak_rss_mb,
    play_episodes,
    play_together,
    result_or_reason,
    run_episode,
)
from care_sim.study.journal import JOURNAL, Journal
from care_sim.study.runner import run_all

MEASURED = {"wall_s", "peak_rss_mb"}
COLLISION = {
    "scenario_parameters": (("encroachment_s", (-0.2, -0.1)), ("ego_speed_mps", (12.0, 13.0)))
}
CASES = {
    "full": ("cutin", "full", 1.0, {}),
    "a lane change": ("cutin", "random", 0.05, {}),
    "hit": ("dartout", "history", 0.01, COLLISION),
    "its own memory": ("dense", "care-sightlines", 0.03, {}),
    "forgets": ("dense", "care-sbf", 0.1, {"false_negative_rate": 0.3, "camera_jitter": 1}),
    "learned": ("dense", "learned-scorer", 0.05, {"camera_latency": 2}),
    "told": ("dartout", "care-sector", 0.02, {"min_returns": 6, "cell_order": "core-spread"}),
    "a test": ("ncap", "care", 0.02, {"lidar_dropout": 0.2, "driver": "careful-human"}),
    "a drive": (
        "drive",
        "care",
        0.01,
        {
            "detector": "centerpoint",
            "camera_profile": "kitti",
            "scenario_parameters": (("duration_s", 1.0),),
        },
    ),
    "unspent": ("dense", "all-camera", 0.3, {"floor": False, "keyframe_s": 0.2}),
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


def test_who_asks_for_truth_and_what_is_not_built_in_is_played_alone():
    asking = EpisodeConfig("dartout", "history-oracle")
    with pytest.raises(InvalidInput, match="asks its own world for the truth"):
        play_together([asking, asking.changed(seed=1)])
    # An episode that is surely alone does not wait for others in a batch.
    for config in (
        asking,
        EpisodeConfig("care_sim.scenarios.dartout:Dartout", "care"),
        EpisodeConfig("dartout", "care", detector="cluster"),
    ):
        assert config.batch != config.changed(seed=1).batch
    for together in (
        EpisodeConfig("dartout", "care"),
        EpisodeConfig("drive", "care", detector="centerpoint", camera_profile="kitti"),
        EpisodeConfig("ncap", "care", engine="bullet", lidar_dropout=0.1),
    ):
        assert together.batch == together.changed(seed=1).batch


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


def test_the_hash_holds_cells_ranges_and_the_pose_of_everybody_at_every_keyframe():
    env = gymnasium.make("CARE-Drive-v0", budget=0.01)
    env.reset(seed=2)
    found, content = EpisodeHash(), hashlib.sha256()
    for _ in range(3):
        observation, *_, info = env.step(np.zeros((32, 512), np.float32))
        world = env.unwrapped.loop.world
        bodies = [world.ego_body, *(actor.body for actor in world.actors)]
        found.add(info["fired"], observation["ranges"], world.boxes_of(np.array(bodies)))
        poses = [world.ego.pose, *(actor.pose_at(world.time) for actor in world.actors)]
        content.update(portable_bytes(info["fired"], observation["ranges"], poses))
    env.close()
    assert found.hexdigest() == content.hexdigest()[:16]


def test_a_row_tells_what_the_seed_drew_of_a_scenario():
    short = ("duration_s", 0.1)
    drawn = (("test", "drawn"), ("speed_kph", 0.0), short)
    rows = [
        run_episode(EpisodeConfig("ncap", "fan", 0.01, seed, scenario_parameters=drawn))
        for seed in range(3)
    ]
    for row in rows:
        pairs = {(each.ego_kph, each.target_kph) for each in TESTS[row["drawn.test"]].variations}
        assert (row["drawn.speed_kph"], row["drawn.target_kph"]) in pairs
        assert row["scenario.test"] == "drawn"
    assert len({row["drawn.test"] for row in rows}) > 1


def test_what_the_parent_holds_is_not_counted():
    held = np.ones(60_000_000)
    assert peak_rss_mb() > held.nbytes / 1e6
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        assert pool.submit(peak_rss_mb).result() < peak_rss_mb() - held.nbytes / 2e6


def test_a_system_that_does_not_tell_the_peak_is_asked_otherwise(monkeypatch):
    monkeypatch.setattr(Path, "read_text", lambda _path: "VmRSS:\t1 kB\n")
    assert 50 < peak_rss_mb() < 100_000


# Every death costs the start of a worker.
@pytest.mark.slow
def test_one_that_kills_its_worker_costs_only_itself(third_party, tmp_path):
    # The car brakes in the second of seeds 1 and 2.
    configs = grid(["dartout"], ["dies-in-the-brake"], [0.03], range(1, 3))
    with Journal(tmp_path / JOURNAL) as journal:
        failures = run_all(configs, journal, 1)
        kept = {config for config in configs if config.key in journal}
    failed = {failure.config for failure in failures}
    assert {failure.reason for failure in failures} == {"the worker process died"}
    assert len(failed) == 1
    assert kept == {*configs} - failed


@pytest.mark.parametrize("outer", [KeyboardInterrupt, SystemError, ValueError])
def test_an_interrupt_is_no_reason_why_an_episode_gave_nothing(outer):
    def play():
        # Compiled code that is interrupted raises SystemError from the interrupt.
        raise outer from KeyboardInterrupt()

    if outer is ValueError:
        assert "ValueError" in result_or_reason(play)
    else:
        with pytest.raises(KeyboardInterrupt):
            result_or_reason(play)
