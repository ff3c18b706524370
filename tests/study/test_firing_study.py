from collections import Counter

from care_sim.sources.scenes import Scene, Streets
from care_sim.study.designs.firing import (
    FIRING_BUDGETS,
    FIRING_POLICIES,
    FIRINGS,
    firing_plays,
    firing_study,
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
