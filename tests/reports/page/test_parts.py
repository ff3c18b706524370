"""Tables, listing and origin of a page, without a browser."""

import pytest

from care_sim.reports.page.build import provenance_of, settings, sort_key
from care_sim.reports.page.listing import _world, episode_groups
from tests.helpers.made_rows import STUDY, rows


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("15.1 [14.0, 16.2]", 15.1),
        ("+3.4* [1.0,5.2]", 3.4),
        ("≤-13.0*", -13.0),
        ("3%", 3.0),
        ("1/5", 0.2),
        ("+26.1° [24.5,27.7]°", 26.1),
        ("not detected", float("-inf")),
        ("not detected [n.d., 3.0]", float("-inf")),
        ("care", None),
        ("", None),
        ("7.8/16.2", None),
        ("0/0", None),
    ],
)
def test_an_entry_is_sorted_by_the_number_it_begins_with(text, key):
    assert sort_key(text) == key


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


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("{", "config.json cannot be read"),
        ("[1]", "config.json is not the description of a study"),
        ('{"machine": {"cores": 2}, "versions": {"code": "abc"}}', None),
    ],
)
def test_what_is_missing_is_said(content, says, tmp_path):
    assert provenance_of(tmp_path, STUDY, []).missing[0].startswith("config.json is missing")
    (tmp_path / "config.json").write_text(content)
    about = provenance_of(tmp_path, STUDY, ["scene c: damaged"])
    *trouble, left_out = about.missing
    assert left_out == "Left out: scene c: damaged."
    if says is None:
        assert (trouble, about.machine, about.code) == ([], {"cores": 2}, "abc")
    else:
        assert trouble[0].startswith(says)


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
