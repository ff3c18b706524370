import pickle
import sys
from dataclasses import asdict, replace
from importlib.machinery import ModuleSpec

import numpy as np
import pytest

from care_sim.base import digests
from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import COLUMNS_WHERE_CHANGED
from care_sim.study import provenance
from care_sim.study.episode_config import (
    ENVIRONMENT_IDS,
    PLAIN_FIELDS,
    EpisodeConfig,
    grid,
    listed_episodes,
)

GOOD = EpisodeConfig("dense", "care")


def test_every_scenario_has_its_environment():
    from care_sim.scenarios import SCENARIOS

    assert set(ENVIRONMENT_IDS) == set(SCENARIOS)


@pytest.mark.parametrize(
    ("change", "names"),
    [
        ({"scenario": "dance"}, ["'dance'", "cutin, dartout, dense, drive, ncap, r157"]),
        ({"policy": "best"}, ["'best'", "all-camera", "care-sbf"]),
        ({"budget": 0.0}, ["budget", "(0, 1]"]),
        ({"budget": 1.1}, ["budget", "(0, 1]"]),
        ({"budget": float("nan")}, ["budget"]),
        ({"seed": -1}, ["seed", ">= 0"]),
        ({"reserve_fraction": 1.5}, ["reserve_fraction", "[0, 1]"]),
        ({"false_negative_rate": -0.1}, ["false_negative_rate", "[0, 1]"]),
        ({"camera_latency": -1}, ["camera_latency", ">= 0"]),
        ({"min_returns": 0}, ["min_returns", ">= 1"]),
        ({"lidar_range_sigma": -1.0}, ["range_sigma"]),
        ({"lidar_dropout": 2.0}, ["dropout", "[0, 1]"]),
        ({"engine": "warp"}, ["'warp'", "bullet"]),
        ({"scenario_parameters": (("wheels", 3),)}, ["'wheels'", "vehicles"]),
        ({"scenario_parameters": (("budget", 1.0),)}, ["'budget'", "vehicles"]),
        ({"scenario_parameters": (("vehicles", 99),)}, ["vehicles", ">= 0 and <= 12"]),
        ({"policy": "care-sbf", "policy_parameters": (("k", 3),)}, ["'k'", "k_safe"]),
        ({"policy": "full", "budget": 0.1}, ["full", "budget=1.0"]),
    ],
)
def test_bad_input_names_the_thing_and_what_is_allowed(change, names):
    with pytest.raises(InvalidInput) as error:
        replace(GOOD, **change)
    assert all(name in str(error.value) for name in names), error.value
    assert "\n" not in str(error.value)


def test_driver_hardware_and_camera_are_columns_only_where_they_are_not_the_default():
    """So that rows and digests of before there was a choice stay as they were."""
    assert not {*COLUMNS_WHERE_CHANGED} & {*GOOD.row()}
    assert replace(GOOD, firing="cells") == GOOD
    camera = {"camera_profile": "yolox", "camera_latency_s": 0.1}
    other = replace(GOOD, driver="careful-human", comfort_mps2=2.0, firing="tiles", **camera)
    added = {"driver": "careful-human", "comfort_mps2": 2.0, "firing": "tiles:4x8", **camera}
    assert other.row() == GOOD.row() | added
    assert other.digest() != GOOD.digest()


def test_the_digest_is_that_of_the_values_and_not_of_their_types():
    ours = EpisodeConfig(
        "dense",
        "care-sbf",
        seed=np.int64(1),
        false_negative_rate=0,
        floor_seed=np.int64(2),
        lidar_dead_rows=[3],
        policy_parameters=(("k_safe", np.float64(1.0)),),
    )
    theirs = EpisodeConfig(
        "dense",
        "care-sbf",
        seed=1,
        floor_seed=2,
        lidar_dead_rows=(3,),
        policy_parameters=(("k_safe", 1.0),),
    )
    assert (ours, hash(ours), ours.digest()) == (theirs, hash(theirs), theirs.digest())


def test_the_digest_tells_every_parameter_apart():
    changes = [
        {"policy": "history"},
        {"budget": 0.2},
        {"seed": 1},
        {"camera_latency": 1},
        {"floor": False},
        {"scenario_parameters": (("vehicles", 4),)},
        {"policy": "care-sbf", "policy_parameters": (("k_safe", 0.0),)},
    ]
    digests = [
        config.digest() for config in (GOOD, *(replace(GOOD, **change) for change in changes))
    ]
    assert len(set(digests)) == len(digests)
    assert EpisodeConfig("dense", "care").digest() == GOOD.digest()


def test_the_digest_covers_the_code(monkeypatch):
    before = GOOD.digest()
    monkeypatch.setattr("care_sim.study.run_config.code_digest", lambda: "edited")
    assert GOOD.digest() != before
    assert len(provenance.code_digest()) == 16


@pytest.fixture
def package(tmp_path, monkeypatch):
    """An installed package with a policy in one module and a table beside it."""
    info = tmp_path / "ours-1.0.dist-info"
    (tmp_path / "ours_policy").mkdir()
    info.mkdir()
    (tmp_path / "ours_policy" / "__init__.py").touch()
    (tmp_path / "ours_policy" / "near.py").write_text(
        "from care_sim.policies.paper.tracks import History as Near\n"
    )
    (tmp_path / "ours_policy" / "table.csv").write_text("1\n")
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: ours\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[care_sim.policies]\nnear = ours_policy.near:Near\n")
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path / "ours_policy"
    provenance._loaded.cache_clear()
    for name in [name for name in sys.modules if name.startswith("ours_policy")]:
        del sys.modules[name]


@pytest.mark.parametrize("edited", ["near.py", "table.csv"])
def test_the_digest_covers_the_package_of_an_installed_policy(package, edited):
    ours = EpisodeConfig("dense", "near")
    before, built_in = ours.digest(), GOOD.digest()
    assert before == EpisodeConfig("dense", "near").digest()
    with (package / edited).open("a") as file:
        file.write("# edited")
    provenance._loaded.cache_clear()
    assert ours.digest() != before
    assert GOOD.digest() == built_in


def test_the_digest_of_a_policy_without_source_holds_for_one_run_and_its_workers(
    package, monkeypatch
):
    monkeypatch.setattr(
        digests, "find_spec", lambda name: ModuleSpec(name, None, origin="/nowhere/ours.zip")
    )
    ours = EpisodeConfig("dense", "near")
    before = ours.digest()
    monkeypatch.setattr("care_sim.study.run_config.SESSION", "another run")
    assert EpisodeConfig("dense", "near").digest() != before
    assert pickle.loads(pickle.dumps(ours)).digest() == before


def test_the_row_is_flat_and_the_label_names_what_is_unusual():
    config = replace(GOOD, camera_latency=2, scenario_parameters=(("vehicles", 7),))
    assert set(config.row()) == {*PLAIN_FIELDS, "scenario.vehicles"} - {*COLUMNS_WHERE_CHANGED}
    assert config.label == "dense care 0.1 seed 0 camera_latency=2 scenario.vehicles=7"


def test_full_runs_once_for_all_budgets():
    configs = grid(["dense"], ["care", "full"], (0.03, 0.1), (0, 1))
    assert [(c.policy, c.budget) for c in configs if c.seed == 0] == [
        ("care", 0.03),
        ("care", 0.1),
        ("full", 1.0),
    ]
    told = listed_episodes(configs)["configurations"]
    assert [(plain["policies"], plain["seeds"]) for plain in told] == [
        (["care"], [0, 1]),
        (["care"], [0, 1]),
        (["full"], [0, 1]),
    ]


def test_what_all_configurations_have_alike_is_told_once():
    configs = [
        *grid(["dense"], ["care", "history"], (0.03, 0.1), (0, 1)),
        *grid(["dense"], ["care"], (0.03,), (7,), camera_latency=1),
    ]
    told = listed_episodes(configs)
    both = ["care", "history"]
    assert told["configurations"] == [
        {"budget": 0.03, "camera_latency": 0, "seeds": [0, 1], "policies": both},
        {"budget": 0.1, "camera_latency": 0, "seeds": [0, 1], "policies": both},
        {"budget": 0.03, "camera_latency": 1, "seeds": [7], "policies": ["care"]},
    ]
    again = [
        {**told["common"], **each, "seed": seed, "policy": policy}
        for each in told["configurations"]
        for policy in each["policies"]
        for seed in each["seeds"]
    ]
    plain = [{k: v for k, v in one.items() if k not in ("seeds", "policies")} for one in again]
    assert sorted(map(str, map(sorted, map(dict.items, plain)))) == sorted(
        str(sorted(asdict(config).items())) for config in configs
    )


def test_a_parameter_may_be_one_policys_own():
    given = (("k_safe", 1.0),), (("care-sbf.k_safe", 1.0),)
    alone, beside = (
        grid(["dense"], ["care-sbf"], [0.1], [0], policy_parameters=each) for each in given
    )
    assert alone == beside
    care, history = grid(["dense"], ["care", "history"], [0.1], [0], policy_parameters=given[1])
    assert care.policy_parameters == history.policy_parameters == ()
    with pytest.raises(InvalidInput, match="unknown policy 'carre'"):
        grid(["dense"], ["care"], [0.1], [0], policy_parameters=(("carre.k_safe", 1.0),))


def test_a_seed_that_is_given_twice_is_one_seed():
    assert [config.seed for config in grid(["dense"], ["care"], [0.1], [7, 7])] == [7]
