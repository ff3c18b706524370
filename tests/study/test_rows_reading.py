from typing import get_args

from care_sim.loops.records import Outcome
from care_sim.study.results_formats import EPISODES
from care_sim.study.rows.parquet import read_rows, write_rows
from care_sim.study.rows.reading import is_avoided, with_added_columns
from tests.helpers.made_rows import rows


def columns(study, policy):
    return [
        (row["regret_m"], row["censored"])
        for row in with_added_columns(study)
        if row["policy"] == policy
    ]


def test_the_regret_of_every_episode_stands_beside_it():
    study = [*rows("history", [4.0, None, 9.0]), *rows("full", [15.0, 16.0, None])]
    assert columns(study, "history") == [(11.0, False), (13.0, True), (-6.0, True)]
    assert columns(study, "full") == [(0.0, False), (0.0, False), (0.0, True)]


def test_without_the_full_scan_of_the_same_world_there_is_no_regret():
    elsewhere = rows("full", [15.0, 15.0], scenario_parameters=(("vehicles", 3),))
    study = [*rows("care", [14.0, None]), *elsewhere]
    assert columns(study, "care") == [(None, False), (None, True)]


def test_what_was_there_stays_and_tags_are_text():
    (before,) = rows("care", [14.0])
    (after,) = with_added_columns([before])
    assert before.items() <= after.items()
    assert after["tags"] == "causal"


def test_a_camera_fault_is_measured_against_the_full_scan_that_asks_no_camera():
    faulty = rows("care", [14.0], scenario="dartout", budget=0.1, false_negative_rates=(0.2,))
    assert columns([*faulty, *rows("full", [15.0], scenario="dartout")], "care") == [(1.0, False)]


def test_a_collision_is_read_again_although_its_hulls_overlap(tmp_path):
    touched = {"collision": True, "impact_speed_mps": 3.5, "clearance_m": -0.1}
    study = with_added_columns(rows("history", [None], changes=touched))
    file = tmp_path / EPISODES.file
    write_rows(study, file, "sweep", [], EPISODES.schema)
    (read,) = read_rows(file, EPISODES.schema)
    assert {name: read[name] for name in touched} == touched


def test_a_stop_for_nothing_avoids_no_collision():
    (row,) = rows("care", [14.0])
    assert is_avoided(row)
    assert not is_avoided(row | {"braked_before_view": True})
    assert not is_avoided(row | {"collision": True})


def test_every_field_of_an_outcome_is_a_column_and_may_lack_what_it_may_lack():
    """Older files lack the further columns."""
    schema = EPISODES.schema
    for name, kind in Outcome.__annotations__.items():
        may_lack = type(None) in get_args(kind) or name in schema.further
        assert {**schema.further, **schema.needed}[name].optional == may_lack
