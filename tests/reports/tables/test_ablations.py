import pytest

from care_sim.core.forgetting import ForgettingRules
from care_sim.reports.table import Bold
from care_sim.reports.tables.ablations import ablation_tables
from care_sim.study.designs.ablations import ABLATION_PLACES, ABLATIONS, ablation_study
from tests.helpers.made_rows import row

SEEDS = range(5)


def distance(config):
    """A made-up law: CARE loses with a small reserve, history is late, the rest sees as far as the
    full scan; the dense street lies 4 m nearer.
    """
    nearer = 4.0 if config.scenario == "dense" else 0.0
    if config.policy == "history":
        return 8.0 - nearer
    return (10.0 if config.reserve_fraction == 0.15 and config.policy == "care" else 16.0) - nearer


@pytest.fixture(scope="module")
def tables():
    rows = [row(config, distance(config)) for config in ablation_study(SEEDS)]
    return {table.title: table for table in ablation_tables(rows)}


def test_every_ablation_has_its_table_filled_in_every_place(tables):
    assert len(tables) == len(ABLATIONS) == 9
    for table, ablation in zip(tables.values(), ABLATIONS, strict=True):
        assert sum(len(line) == 1 for line in table.rows) == len(ABLATION_PLACES)
        lines = [line for line in table.rows if len(line) > 1]
        assert len(lines) == len(ABLATION_PLACES) * len(ablation.levels)
        assert all(line[1] for line in lines)
        assert sum("(usual)" in line[0] for line in lines) == len(ABLATION_PLACES)
        assert all(entry for line in lines for entry in line[5:])
        assert all(bool(line[4]) != ("(usual)" in line[0]) for line in lines)


def test_a_level_is_compared_with_the_usual_one_and_with_others_at_its_level(tables):
    table = tables["care: reserve fraction rho"]
    assert table.columns[4:] == ("minus usual", "minus history", "minus all-camera")
    small, usual = table.rows[1], table.rows[2]
    assert small == (
        "0.15",
        "10.0",
        "[10.0, 10.0]",
        "5/5",
        "-6.0* [-6.0,-6.0]",
        "+2.0 [2.0,2.0]",
        "-6.0* [-6.0,-6.0]",
    )
    assert isinstance(small[4], Bold)
    street = table.rows[9]
    assert street[:3] == ("0.15", "6.0", "[6.0, 6.0]")
    assert street[4:] == small[4:]
    assert usual[0] == "0.3 (usual)"
    assert usual[4] == ""
    assert usual[5] == "+8.0* [8.0,8.0]"


def test_the_levels_are_the_papers():
    levels = {
        ablation.title.partition(",")[0]: [level.label for level in ablation.levels]
        for ablation in ABLATIONS
    }
    assert levels["reserve fraction rho"] == ["0.15", "0.3", "0.5"]
    assert levels["scale k_safe of the guard"] == ["0", "0.25", "0.5", "1", "1.5", "2"]
    assert len(levels["margin forgotten a keyframe"]) == 4
    assert levels["seed of the shared floor"] == ["0", "1", "2"]
    assert levels["least confidence of the camera"] == ["0.25", "0.5"]


def test_every_level_is_played_once_and_the_defaults_without_parameters():
    configs = ablation_study([3])
    assert len(configs) == len(set(configs)) == 162
    guards = {
        dict(c.policy_parameters)["k_safe"]
        for c in configs
        if "k_safe" in dict(c.policy_parameters)
    }
    assert guards == {0, 0.25, 0.5, 1, 1.5}
    assert ForgettingRules().k_safe == 2.0
    assert {(c.azimuth_margin, c.elevation_margin) for c in configs} == {(1, 1), (2, 1), (4, 2)}


def test_a_further_policy_stands_beside_the_papers_in_conditions_that_it_feels():
    configs = ablation_study(SEEDS, ["uncertainty", "care"])
    assert len(configs) == len(set(configs))
    tables = ablation_tables([row(config, distance(config)) for config in configs])
    columns = [table.columns for table in tables]
    assert sum("minus uncertainty" in names for names in columns) == 5
    assert not any("minus care" in names for names in columns[:5])
    assert all(line[-1] for table in tables[:5] for line in table.rows if len(line) > 1)


@pytest.mark.parametrize("policy", ["care-sbf", "history-oracle"])
def test_every_further_policy_that_is_played_is_shown_and_marked(policy):
    rows = [row(config, distance(config)) for config in ablation_study(range(2), [policy])]
    tags = {"history-oracle": "privileged"}
    table = ablation_tables([each | {"tags": tags.get(each["policy"], "causal")} for each in rows])[
        0
    ]
    assert (
        table.columns[-1]
        == {"care-sbf": "minus care-sbf", "history-oracle": "minus history-oracle †"}[policy]
    )
    assert bool(table.notes) == (policy == "history-oracle")
