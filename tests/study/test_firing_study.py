from collections import Counter

from care_sim.core.grid import AngularGrid
from care_sim.core.sensor_setup import SensorSetup
from care_sim.sources.scenes import Scene, Streets
from care_sim.study.designs.defaults import FIRING_POLICIES
from care_sim.study.designs.firing import (
    FIRING_BUDGETS,
    FIRINGS,
    firing_plays,
    firing_study,
    fitting,
    rows_by_firing,
)

STREETS = Streets("evaluation")
SCENES = [Scene("street-0000", 0), Scene("street-0001", 1)]


def test_the_full_scan_is_played_once_and_belongs_to_every_hardware():
    configs = firing_study([0], ["fan"])
    budgeted = len(FIRING_POLICIES) * len(FIRING_BUDGETS)
    assert len(configs) == len(set(configs)) == len(FIRINGS) * budgeted + 1
    by_firing = rows_by_firing([config.row() for config in configs])
    assert tuple(by_firing) == FIRINGS
    for own in by_firing.values():
        assert len(own) == budgeted + 1
        assert Counter(row["policy"] for row in own)["full"] == 1
        assert {row.get("firing") for row in own} == {None}


def test_plays_of_a_source_are_those_of_the_protocol_under_every_hardware():
    plays = firing_plays(STREETS, SCENES, ["care", "full"], [0.1], [0, 1])
    assert len(plays) == len(set(plays)) == 2 * (len(FIRINGS) * 2 + 1)
    assert {play.firing for play in plays if play.policy == "care"} == {*FIRINGS}


def test_the_full_scan_alone_stands_under_free_cells():
    plays = firing_plays(STREETS, SCENES, ["full"], [0.1])
    assert [*rows_by_firing([play.row() for play in plays])] == ["cells"]


def test_what_does_not_fit_a_set_up_is_left_out_with_a_line():
    fits = fitting("m1-forward")
    assert fits.firings == ["cells", "rows", "columns", "vertical-window", "energy:4"]
    assert set(FIRING_POLICIES) - {*fits.policies} == {"place"}
    said = " ".join(fits.left_out)
    assert "left out with m1-forward: tiles:4x8 (rows of firing tiles must divide the 126" in said
    assert "place (weights" in said
    assert len(fits.left_out) == 4
    assert fitting("hdl-32e").left_out == []


def test_hardware_of_which_the_least_budget_buys_no_unit_does_not_fit():
    """Of four rows 3% are none."""
    setup = SensorSetup("four", AngularGrid(512, 4, 0.05, -0.05))
    assert "rows" not in fitting(setup).firings
    assert "left out with four: rows (budget 0.03 leaves no row of 4" in " ".join(
        fitting(setup).left_out
    )


def test_every_set_up_is_played_under_what_fits_it():
    configs = firing_study([0], ["fan"], ["hdl-32e", "m1-forward"])
    other = [config for config in configs if config.sensor == "m1-forward"]
    assert len(configs) - len(other) == len(firing_study([0], ["fan"]))
    assert len(other) == 5 * len(FIRING_POLICIES[1:]) * len(FIRING_BUDGETS) + 1
    assert "fan" in {config.policy for config in other}


def test_plays_of_a_source_are_under_what_fits_its_set_up():
    streets = Streets("evaluation", sensor="m1-forward")
    plays = firing_plays(streets, SCENES[:1], ["care"], [0.1])
    assert [play.firing for play in plays] == fitting("m1-forward").firings
