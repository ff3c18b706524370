"""The first-sighting protocol over hand-built drives: plays, rows, events, and a run that meets
damaged files.
"""

import json
import shutil
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.commands.shared.run_study import run_study
from care_sim.evaluation.recall import Tally
from care_sim.reports.protocol.rows import plays_by_setting
from care_sim.reports.report import read_results
from care_sim.reports.studies import STUDIES
from care_sim.sources.named import source_of
from care_sim.sources.scenes import Scene
from care_sim.study import scene_play as plays
from care_sim.study.play_config import PLAY_FIELDS, listed_plays, play_grid
from care_sim.study.runner import in_batches
from tests.helpers.av2_log import at, box, write

MEASURED = {"wall_s", "peak_rss_mb", *plays.DECISION_MS}
PROTOCOL = STUDIES["protocol"]


@pytest.fixture
def folder(drive, tmp_path):
    """Two sound logs and one whose annotations are cut off."""
    logs = tmp_path / "logs"
    for name in ("a", "b", "torn"):
        shutil.copytree(drive, logs / name)
    torn = logs / "torn" / "annotations.feather"
    torn.write_bytes(torn.read_bytes()[:1000])
    return logs


@pytest.fixture
def source(folder):
    return source_of(f"argoverse2:{folder}")


def small(
    source, policies=("history", "care"), budgets=(0.05,), floors=(0,), scenes=("a",), **common
):
    return play_grid(
        source, [Scene(name, 0) for name in scenes], policies, budgets, floors, **common
    )


def steady(row):
    return {name: value for name, value in row.items() if name not in MEASURED}


def attempted(configs):
    return [row for batch in in_batches(configs) for row in plays.play_scene(batch)]


def test_a_play_is_one_row_with_the_sums_of_the_scene_and_of_its_strata(source):
    (config,) = small(source, ["care"])
    (row,) = attempted([config])
    assert set(PLAY_FIELDS) | set(plays.SUMS) < set(row)
    assert (row["source"], row["scene"], row["digest"]) == ("argoverse2", "a", config.digest())
    assert (row["keyframes"], row["events"], row["sighted"], row["ttfds"]) == (10, 1.0, 1.0, (0,))
    for kind, labels in {"range": 3, "azimuth": 3, "class": 5, "entry": 4}.items():
        parts = [name for name in row if name.startswith(f"{kind}/") and name.endswith("/frames")]
        assert len(parts) == labels
        assert sum(row[name] for name in parts) == row["frames"]
    assert row["class/pedestrian/events"] == 1.0
    assert 2 < row["tracks"] < 4
    assert (row["differing_keyframes"], row["differing_cells"]) == (None, None)


def test_the_rows_of_a_play_do_not_depend_on_what_was_played_beside_it(source):
    together = small(source, ["history", "care", "full"], floors=(0, 1))
    rows = attempted(together)
    for config, row in zip(together, rows, strict=True):
        assert steady(attempted([config])[0]) == steady(row)
    backwards = attempted(together[::-1])
    assert [steady(row) for row in backwards[::-1]] == [steady(row) for row in rows]


def test_allocations_are_compared_with_those_of_care_under_the_same_conditions(source):
    rows = {
        row["policy"]: row for row in attempted(small(source, ["history", "care-priority", "full"]))
    }
    assert rows["full"]["differing_keyframes"] is None
    assert 0 < rows["history"]["differing_keyframes"] <= 10
    assert rows["history"]["differing_cells"] > 10
    for blind in attempted(small(source, ["history"], floors=(0, 1), false_negative_rate=1.0)):
        assert (blind["differing_keyframes"], blind["differing_cells"]) == (0, 0)


def test_full_plays_once_for_all_that_it_does_not_feel(source):
    configs = small(
        source, ["full", "care"], budgets=(0.1, 0.2), floors=(0, 1, 2), camera_latencies=(0, 1)
    )
    full = [config for config in configs if config.policy == "full"]
    assert [(config.budget, config.camera_latency, config.floor_seed) for config in full] == [
        (1.0, 0, 0)
    ]
    assert len(configs) == 1 + 2 * 3 * 2
    assert len({config.digest() for config in configs}) == len(configs)


def test_the_row_names_every_condition_and_the_label_what_departs(source):
    (config,) = small(
        source, ["care-sbf"], camera_latency=1, policy_parameters=(("k_safe", 1.0),), floors=(2,)
    )
    assert set(config.row()) == {*PLAY_FIELDS, "recording", "policy.k_safe"}
    assert config.label == "a care-sbf 0.05 camera_latency=1 floor_seed=2 policy.k_safe=1.0"
    assert listed_plays([config])["scenes"] == ["a"]
    assert listed_plays([config])["configurations"][0]["floor_seeds"] == [2]
    with pytest.raises(InvalidInput, match="engine cannot be changed in the open loop"):
        replace(config, engine="bullet")
    with pytest.raises(InvalidInput, match="unknown detector 'yolo'"):
        replace(config, detector="yolo")
    with pytest.raises(InvalidInput, match="k_safe"):
        replace(config, policy="care")


def test_the_presence_is_part_of_the_digest_and_a_column_where_it_is_not_the_rule(tmp_path):
    van = box("BOX_TRUCK", (20.0, -4.0, 0.9), (6.0, 2.2, 2.6), track="van")
    person = box("PEDESTRIAN", (14.0, 3.0, 0.6), (0.6, 0.7, 1.8), track="p", points=0)
    write(
        tmp_path / "a",
        [[van, person]] * 5 + [[van, person | {"num_interior_pts": 4}]] * 6,
        [at()] * 11,
    )
    source = source_of(f"argoverse2:{tmp_path}")
    rule, sight = (
        small(source, ["full"], presence=presence)[0] for presence in ("annotated", "visible")
    )
    assert rule.digest() != sight.digest()
    assert "presence" not in rule.row()
    assert (sight.row()["presence"], sight.label) == ("visible", "a full 1 presence=visible")
    by_rule, by_sight = attempted([rule, sight])
    assert (by_rule["events"], by_rule["emerging"], by_rule["ttfds"]) == (0.0, 1, ())
    assert (by_sight["events"], by_sight["emerging"], by_sight["ttfds"]) == (1.0, 1, (0,))
    assert by_rule["episode_hash"] == by_sight["episode_hash"]
    assert (
        (by_rule["frames"], by_rule["found"])
        == (by_sight["frames"], by_sight["found"])
        == (5.0, 5.0)
    )
    assert [plays_by_setting([row])[0].setting.label for row in (by_rule, by_sight)] == [
        "Argoverse 2, detector returns",
        "Argoverse 2, detector returns, presence visible",
    ]
    with pytest.raises(InvalidInput, match="presence must be 'annotated' or 'visible', got 'seen'"):
        replace(rule, presence="seen")


def test_a_damaged_scene_is_named_left_out_and_the_rest_goes_on(source, tmp_path, folder):
    configs = small(source, scenes=("torn", "a", "b"))
    failures = run_study(configs, tmp_path / "out", workers=1, study=PROTOCOL)
    assert [failure.config.scene.name for failure in failures] == ["torn", "torn"]
    assert str(folder / "torn" / "annotations.feather") in failures[0].reason
    rows, study, left_out = read_results(tmp_path / "out")
    assert study is PROTOCOL
    assert [row["scene"] for row in rows] == ["a", "a", "b", "b"]
    assert [row["tags"] for row in rows] == ["causal"] * 4
    (line,) = left_out
    assert line.startswith("2 plays, the first torn history 0.05: ")
    assert "annotations.feather" in line
    assert f"Left out: {line}." in (tmp_path / "out" / "tables.md").read_text()
    assert json.loads((tmp_path / "out" / "config.json").read_text())["failed"] == [
        *map(str, failures)
    ]


def test_the_events_are_kept_one_by_one(source, tmp_path):
    assert (
        run_study(
            small(source, floors=(0, 1), scenes=("a", "b")), tmp_path, workers=1, study=PROTOCOL
        )
        == []
    )
    events = pq.read_table(tmp_path / "events.parquet").to_pylist()
    rows, *_ = read_results(tmp_path)
    assert len(events) == 8
    for event, row in zip(events, rows, strict=True):
        assert (event["digest"], event["ttfd"]) == (row["digest"], row["ttfds"][0])
        assert event["detected"] == (row["sighted"] == 1.0)
        assert (event["keyframe"], event["class"], event["chances"]) == (5, "pedestrian", 5)
        assert event["range_m"] == pytest.approx(np.hypot(23.5 - 1.35, 7.0), abs=2e-3)
    assert "sightings" not in rows[0]


def test_a_scene_without_an_event_has_a_row_too(tmp_path):
    far = box("REGULAR_VEHICLE", (70.0, 0.0, 0.42))
    write(tmp_path / "empty", [[far]] * 15, [at()] * 15)
    (row,) = attempted(small(source_of(f"argoverse2:{tmp_path}"), ["care"], scenes=("empty",)))
    assert Tally(*(row[name] for name in plays.SUMS)) == Tally()
    assert row["ttfds"] == ()
