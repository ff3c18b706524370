"""Tables, listing and origin of a page, without a browser."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.reports.page.listing import _world, episode_groups
from care_sim.reports.page.provenance import provenance_of, settings
from care_sim.reports.page.sorting import sort_key
from care_sim.study.results_formats import EPISODES, PLAYS
from tests.helpers.made_rows import STUDY, rows


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("15.1 [14.0, 16.2]", 15.1),
        ("+3.4* [1.0,5.2]", 3.4),
        ("≤-13.0*", -13.0),
        ("~+2 [0,4]", 2.0),
        ("3%", 3.0),
        ("1/5", 0.2),
        ("5/5", 1.0),
        ("+26.1° [24.5,27.7]°", 26.1),
        ("12", 12.0),
        ("not detected", float("-inf")),
        ("not detected [n.d., 3.0]", float("-inf")),
        ("care", None),
        ("", None),
        ("3D", None),
        ("7.8/16.2", None),
        ("0/0", None),
    ],
)
def test_an_entry_is_sorted_by_the_number_it_begins_with(text, key):
    assert sort_key(text) == key


@given(st.lists(st.decimals(-999, 999, places=1, allow_nan=False), min_size=2))
def test_signed_numbers_sort_as_their_values(values):
    texts = [f"{value:+.1f} [0.0,1.0]" for value in values]
    assert sorted(texts, key=sort_key) == [f"{value:+.1f} [0.0,1.0]" for value in sorted(values)]


def test_the_listing_has_a_line_a_configuration_and_an_entry_a_seed():
    played = [*STUDY, *rows("care", [9.0], budget=0.05, changes={"collision": True})]
    (group,) = episode_groups(played, [])
    assert (group.label, group.worlds, group.watchable) == (
        "dense",
        ["seed 0", "seed 1", "seed 2", "seed 3", "seed 4"],
        0,
    )
    by_name = group.configurations
    assert [outcome.text for outcome in by_name["history", "3%"]] == [
        "4.0",
        "never",
        "8.0",
        "6.0",
        "never",
    ]
    assert by_name["care", "5%"][0].collision
    assert by_name["care", "5%"][1:] == [None] * 4
    assert by_name["history", "3%"][1].about == "never detected, braked"


CONFIGURATIONS = [{"policy": "care", "seeds": [0, 1, 2, 3, 4]}] * 4


def describe(folder, content):
    (folder / "config.json").write_text(
        content if isinstance(content, str) else json.dumps(content)
    )


def test_a_whole_folder_lacks_nothing(tmp_path):
    versions = {"code": "abc", "numpy": "2"}
    describe(
        tmp_path, {"machine": {"cores": 2}, "versions": versions, "configurations": CONFIGURATIONS}
    )
    about = provenance_of(tmp_path, STUDY, EPISODES, [])
    assert (about.missing, about.machine, about.code) == ((), {"cores": 2}, "abc")


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (None, "config.json is missing"),
        ("{", "config.json cannot be read"),
        ("[1]", "config.json is not the description of a study"),
        (
            {"configurations": [*CONFIGURATIONS, {"seeds": [7]}]},
            "1 of 21 episodes are missing from episodes.parquet",
        ),
        ({"configurations": [{"seeds": 3}]}, "The configurations in config.json cannot be read"),
    ],
)
def test_what_is_missing_is_said(content, says, tmp_path):
    if content is not None:
        describe(tmp_path, content)
    (sentence,) = provenance_of(tmp_path, STUDY, EPISODES, []).missing
    assert sentence.startswith(says)


def test_plays_are_counted_by_scene_and_floor(tmp_path):
    describe(tmp_path, {"scenes": ["a", "b"], "configurations": [{"floor_seeds": [0, 1, 2]}]})
    about = provenance_of(tmp_path, STUDY[:5], PLAYS, ["scene c: damaged"])
    assert about.missing == (
        "1 of 6 plays are missing from plays.parquet.",
        "Left out: scene c: damaged.",
    )


def test_what_failed_is_told_once(tmp_path):
    failed = ["care 3% seed 7: the worker process died"]
    describe(tmp_path, {"failed": failed, "configurations": [*CONFIGURATIONS, {"seeds": [7]}]})
    assert provenance_of(tmp_path, STUDY, EPISODES, failed).missing == (f"Left out: {failed[0]}.",)
    describe(tmp_path, {"failed": failed, "configurations": [*CONFIGURATIONS, {"seeds": [7, 8]}]})
    lost, left_out = provenance_of(tmp_path, STUDY, EPISODES, failed).missing
    assert lost == "1 of 22 episodes are missing from episodes.parquet."
    assert left_out == f"Left out: {failed[0]}."


def test_settings_are_what_varies_or_departs_from_the_default():
    played = [
        *STUDY,
        *rows("care", [1.0], false_negative_rate=0.4, scenario_parameters=(("vehicles", 9),)),
    ]
    told = settings([{**dict.fromkeys(["scenario.vehicles"]), **row} for row in played])
    assert told["policy"] == "history, all-camera, care, full"
    assert told["false_negative_rate"] == "0, 0.4"
    assert told["scenario.vehicles"] == "not given, 9"
    assert "camera_latency" not in told
    assert (
        settings([row | {"seed": seed} for seed, row in enumerate(STUDY)])["seed"]
        == "0 to 19, 20 values"
    )


def test_a_parameter_of_zero_makes_another_world_than_none():
    usual = {"scenario": "dense", "seed": 0, "scenario.vehicles": None}
    assert _world(usual | {"policy": "care"}) == _world(usual | {"policy": "history"})
    assert _world(usual) != _world(usual | {"scenario.vehicles": 0})
    assert _world(usual) != _world(usual | {"seed": 1})
