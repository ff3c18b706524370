"""The speed measure: every figure is there and adds up; how large it is, is the machine's business."""

import json

import pytest

from care_sim import bench
from care_sim.envs import CLOSED_LOOP
from care_sim.errors import InvalidInput
from care_sim.perception.memory import TrackMemory
from care_sim.policies.base import Policy
from care_sim.policies.care import Care
from care_sim.sensors.camera import Picture

TINY = {"seconds": 0.01, "repeats": 2}


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    out = tmp_path_factory.mktemp("bench") / "new" / "bench.json"
    kept = (Policy.__call__, vars(Picture)["of"], TrackMemory.update)
    assert bench.run(bench.BenchConfig(**TINY, out=out)) == 0
    assert (Care.__call__, vars(Picture)["of"], TrackMemory.update) == kept
    return json.loads(out.read_text())


def test_every_environment_is_measured_in_every_round(measured):
    assert set(measured["speed"]) == {*CLOSED_LOOP, bench.REFERENCE}
    for figures in measured["speed"].values():
        assert all(len(figures[name]) == 2 for name in ("steps_per_s", "inits_per_s"))
        assert min(figures["steps_per_s"] + figures["inits_per_s"]) > 0


def test_the_stages_add_up_to_the_keyframe(measured):
    stages = {name: values[0] for name, values in measured["stages"].items()}
    whole = stages.pop("whole keyframe")
    quantiles = [stages.pop(f"{bench.POLICY}, p{q}") for q in (50, 99)]
    assert set(stages) == {bench.POLICY, *bench.STAGES, "the rest"}
    assert sum(stages.values()) == pytest.approx(whole)
    assert min(stages.values()) > 0
    assert quantiles[0] <= quantiles[1]


def test_machine_versions_memory_and_targets_are_named(measured):
    assert measured["machine"]["cores"] >= 1
    assert {"python", "pybullet", "highway-env", "gymnasium"} <= set(measured["versions"])
    assert 50 < measured["memory_mb"] < 5000
    assert len(measured["targets"]) == 2
    tables = bench.tables(measured)
    words = " ".join(str(part) for table in tables for part in (*table.rows, *table.notes))
    assert measured["machine"]["processor"] in words
    assert f"times the steps/s of {bench.REFERENCE}" in words


def test_targets_are_held_against_the_figures(measured):
    speeds = sorted(measured["speed"]["CARE-Dense-v0"]["steps_per_s"])
    reached = sum(speeds) / 2
    assert list(measured["targets"].values()) == [
        reached >= bench.TARGET_STEPS_PER_S,
        measured["memory_mb"] < bench.TARGET_MEMORY_MB,
    ]


@pytest.mark.parametrize(
    ("wrong", "named"), [({"seconds": 0.0}, "seconds"), ({"repeats": 0}, "repeats"), ({"policy": "wisest"}, "policy")]
)
def test_bad_input_is_named(wrong, named):
    with pytest.raises(InvalidInput, match=named):
        bench.measure(bench.BenchConfig(**{**TINY, **wrong}))
