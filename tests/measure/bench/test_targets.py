"""Ratios and targets, from a report written by hand."""

import pytest

from care_sim.measure.bench.batches import ENVPOOL, row
from care_sim.measure.bench.learning import PPO
from care_sim.measure.bench.ratios import (
    BY_THE_CLOCK,
    MANY_OVER_DRIVING,
    MANY_OVER_ENVPOOL,
    MANY_OVER_REACHING,
    OVER_DRIVING,
    OVER_REACHING,
    PPO_OVER_DRIVING,
    TWO_OVER_ONE,
    TWO_THREADS_OVER_ONE,
    beside,
    over,
    ratios,
    same_on_grid,
)
from care_sim.measure.bench.steps import DRIVE, TESTS
from care_sim.measure.bench.targets import targets

MAIN = "CARE-Dense-v0"


def engine(scan, poses=0.01):
    return {"poses_ms": [poses], "cast_ms": [scan - poses], "scan_ms": [scan]}


@pytest.fixture
def report():
    report = {
        "main": "CARE-Dense-v0",
        "config": {"scenario": "dense", "policy": "care", "budget": 0.1},
        "study": {"episodes": 49.0, "seconds": 10.0},
        "speed": {
            "CARE-Dense-v0": {
                "steps_per_s": [250.0, 400.0, 900.0],
                "steps_per_cpu_s": [500.0, 600.0, 900.0],
            },
            DRIVE: {"steps_per_s": [200.0], "steps_per_cpu_s": [240.0]},
            TESTS: {"steps_per_s": [290.0], "steps_per_cpu_s": [300.0]},
            "highway-fast-v0": {"steps_per_s": [20.0], "steps_per_cpu_s": [30.0]},
            "PandaReach-v3": {"steps_per_s": [250.0], "steps_per_cpu_s": [300.0]},
        },
        "batches": {
            row(1): {"steps_per_s": [3000.0], "steps_per_cpu_s": [3300.0]},
            row(2): {"steps_per_s": [900.0, 4000.0, 5000.0], "steps_per_cpu_s": [2900.0]},
            PPO: {"steps_per_s": [2400.0], "steps_per_cpu_s": [1500.0]},
            ENVPOOL: {"steps_per_s": [40_000.0], "steps_per_cpu_s": [20_000.0]},
        },
        "stages": {"cast": [0.2], "camera": [1.2], "the rest": [0.6], "whole keyframe": [2.0]},
        "vectorised": {"1": [500.0], "2": [950.0]},
        "choices": {"p50": [0.3], "p99": [0.6], "demand": [0.1], "allocation": [0.15]},
        "scans": {
            "engines": {
                "bullet": engine(2.0),
                "fast": engine(0.1, 0.06),
                "Embree (Open3D)": engine(0.25),
            }
        },
        "growth": {"grid": {"ms": {"bullet": [2.0, 2.0, 2.0], "fast": [0.1, 0.1, 0.2]}}},
        "memory": {"resets": 2000, "begun_mb": 180.0, "early_mb": 230.0, "peak_mb": 260.0},
        "batch_memory": {
            "resets": 2048,
            "begun_mb": 200.0,
            "early_mb": 508.0,
            "peak_mb": 510.0,
            "threads_left": 1.0,
        },
    }
    return {**report, "ratios": ratios(report)}


def test_ratios_are_of_medians_and_larger_is_better(report):
    assert report["ratios"] == pytest.approx(
        {
            OVER_DRIVING: 20.0,
            OVER_REACHING: 2.0,
            beside(row(1), MAIN): 5.5,
            beside(row(1), "highway-fast-v0"): 110.0,
            beside(row(1), "PandaReach-v3"): 11.0,
            beside(TESTS, MAIN): 0.5,
            beside(DRIVE, MAIN): 0.4,
            PPO_OVER_DRIVING: 50.0,
            MANY_OVER_DRIVING: 200.0,
            MANY_OVER_REACHING: 16.0,
            MANY_OVER_ENVPOOL: 0.1,
            TWO_THREADS_OVER_ONE: 4 / 3,
            over("fast", "bullet"): 20.0,
            over("fast", "Embree (Open3D)"): 2.5,
            same_on_grid("fast"): 0.5,
            TWO_OVER_ONE: 1.9,
        }
    )


def test_what_is_missed_names_what_holds_it(report):
    made = targets(report)
    assert {target.name: target.holder for target in made if not target.met} == {
        "CARE-Dense-v0: steps/s": "camera, 60%",
        f"{DRIVE}: steps/s": "",
        f"{row(1)}: steps/s": "",
        f"{row(2)}: steps/s": "",
        over("fast", "Embree (Open3D)"): "poses, 60%",
        same_on_grid("fast"): "poses, 60%",
        "policy + allocation, p99 in ms": "allocation, 50%",
        "a worker, MB": "libraries, 69%",
        "a worker, MB gained by resets": "",
        "64 worlds, MB": "episodes, 61%",
        "64 worlds, threads left when closed": "",
        "the paper's 245 episodes on 2 cores, s": "",
    }
    assert len(made) == 18
    assert made[-1].figure == pytest.approx(50.0)


def test_ratios_by_the_clock_are_those_of_threads_and_processes(report):
    assert set(report["ratios"]) >= BY_THE_CLOCK
    assert all(name.startswith("steps/s, ") for name in BY_THE_CLOCK)
    assert not any(name.startswith("steps/s, ") for name in set(report["ratios"]) - BY_THE_CLOCK)


def test_without_engine_and_peer_nothing_is_said_of_them(report):
    del (
        report["scans"]["engines"]["fast"],
        report["growth"]["grid"]["ms"]["fast"],
        report["speed"]["PandaReach-v3"],
        report["speed"][DRIVE],
        report["speed"][TESTS],
        report["batches"][PPO],
        report["batches"][ENVPOOL],
    )
    report["ratios"] = ratios(report)
    assert set(report["ratios"]) == {
        OVER_DRIVING,
        beside(row(1), MAIN),
        beside(row(1), "highway-fast-v0"),
        MANY_OVER_DRIVING,
        TWO_THREADS_OVER_ONE,
        over("bullet", "Embree (Open3D)"),
        same_on_grid("bullet"),
        TWO_OVER_ONE,
    }
    assert [target.name for target in targets(report)] == [
        "CARE-Dense-v0: steps/s",
        f"{row(2)}: steps/s",
        f"{row(1)}: steps/s",
        MANY_OVER_DRIVING,
        TWO_OVER_ONE,
        "policy + allocation, p99 in ms",
        "a worker, MB",
        "a worker, MB gained by resets",
        "64 worlds, MB",
        "64 worlds, MB gained by resets",
        "64 worlds, threads left when closed",
        "the paper's 245 episodes on 2 cores, s",
    ]


def test_another_scenario_is_held_against_nothing(report):
    report["config"]["scenario"] = "dartout"
    assert targets(report) == []
