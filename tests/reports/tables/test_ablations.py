"""Ablations of both loops on rows with known answers, the paper's figures beside them."""

import pytest

from care_sim.core.forgetting import ForgettingRules
from care_sim.reports.protocol.paper_ablations import PUBLISHED_CHANGES, USUAL
from care_sim.reports.studies import STUDIES
from care_sim.reports.table import Bold
from care_sim.reports.tables.ablations import ablation_tables
from care_sim.sources.scenes import Scene, Streets
from care_sim.study.designs.ablations import (
    ABLATION_PLACES,
    ABLATIONS,
    OPEN_ABLATIONS,
    ablation_plays,
    ablation_study,
)
from tests.helpers.made_plays import found, play
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


def block(table, heading):
    """The lines under a heading by name, those of the paper apart."""
    start = table.rows.index((heading,)) + 1
    found, name = {}, ""
    for line in table.rows[start:]:
        if len(line) == 1:
            break
        name = f"{name} (paper)" if line[0] == "(paper)" else line[0]
        found[name] = line[1:]
    return found


def test_every_ablation_has_its_table_filled_in_every_place(tables):
    assert len(tables) == len(ABLATIONS) == 9
    for table, ablation in zip(tables.values(), ABLATIONS, strict=True):
        names = [name.removesuffix(" (usual)") for name in table.columns[1:]]
        assert names == [level.label for level in ablation.levels]
        usual = ["(usual)" in name for name in table.columns[1:]]
        assert sum(usual) == 1
        for place in ABLATION_PLACES:
            lines = block(table, f"{place}, first detection m")
            assert [not entry for entry in lines.pop("minus usual")] == usual
            assert all(entry for line in lines.values() for entry in line)


def test_a_level_is_compared_with_the_usual_one_and_with_others_at_its_level(tables):
    table = tables["care: reserve fraction rho"]
    assert table.columns[:3] == ("", "0.15", "0.3 (usual)")
    lines = block(table, "dartout, 3%, first detection m")
    assert {name: line[:2] for name, line in lines.items()} == {
        "care": ("10.0", "16.0"),
        "quartiles": ("[10.0, 10.0]", "[16.0, 16.0]"),
        "braked": ("5/5", "5/5"),
        "minus usual": ("-6.0* [-6.0,-6.0]", ""),
        "minus history": ("+2.0 [2.0,2.0]", "+8.0* [8.0,8.0]"),
        "minus all-camera": ("-6.0* [-6.0,-6.0]", "+0.0 [0.0,0.0]"),
    }
    assert isinstance(lines["minus usual"][0], Bold)
    street = block(table, "dense, 2%, first detection m")
    assert street["care"][0] == "6.0"
    assert street["minus usual"] == lines["minus usual"]


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
    tags = {"uncertainty": "privileged"}
    rows = [
        row(config, distance(config), tags=tags.get(config.policy, "causal")) for config in configs
    ]
    found = [
        "minus uncertainty †" in block(table, "dartout, 3%, first detection m")
        for table in ablation_tables(rows)
    ]
    assert found == [True] * 5 + [False] * 4


EVENTS = 15
STREETS = Streets("evaluation")
SCENES = [Scene(f"street-{seed:04d}", seed) for seed in range(6)]


def outcome(config):
    """First sightings, object frames found of a near event and of another, and cells released.
    Unguarded forgetting loses what is near and releases more, history finds little, a strict camera
    costs first sightings.
    """
    parameters = dict(config.policy_parameters)
    strict = config.camera_confidence == 0.5
    if config.policy == "full":
        return 12, 9, 9, 0.0
    if config.policy == "history":
        return 1 if strict else 3, 6, 6, 0.0
    if strict:
        return 6, 7, 7, 0.0
    if parameters.get("k_safe") == 0:
        return 9, 4, 7, 60.0
    return 9, 7, 7, 24.0 if config.policy == "care-sbf" else 0.0


def made(config):
    sighted, near, other, released = outcome(config)
    row = config.row()
    given = {name: row[name] for name in row if name not in ("source", "scene", "policy")}
    return play(
        config.scene.name,
        config.policy,
        found(EVENTS, sighted),
        # Events take turns in the strata, of which the first of range is the near field.
        [near, other, other] * (EVENTS // 3),
        released=released,
        **given,
    )


@pytest.fixture(scope="module")
def plays():
    return [made(config) for config in ablation_plays(STREETS, SCENES, [0.1, 0.2], ["random"])]


def titled(rows, part):
    (table,) = (table for table in ablation_tables(rows) if part in table.title)
    return table


def test_near_field_and_released_cells_stand_beside_the_papers(plays):
    table = titled(plays, "k_safe")
    assert (table.columns[1], table.columns[-1]) == ("0", "2 (usual)")

    def ends(heading):
        return {name: (line[0], line[-1]) for name, line in block(table, heading).items()}

    assert ends("10%, first sightings %") == {
        "care-sbf": ("60.0", "60.0"),
        "released": ("60", "24"),
        "released (paper)": ("", "24"),
        "minus usual": ("+0.0 [0.0,0.0]", ""),
        "minus care": ("+0.0 [0.0,0.0]", "+0.0 [0.0,0.0]"),
    }
    near = ends("10%, below 20 m %")
    assert near["care-sbf"] == ("40.0", "70.0")
    assert near["minus usual"] == ("-30.0 [-30.0,-30.0]", "")
    assert near["minus care (paper)"] == ("-1.8 [-2.9,-0.5]", "tied, -0.5 [-1.7,0.4]")
    assert ends("20%, below 20 m %")["minus care (paper)"][1] == "-3.1 [-4.7,-1.5]"
    assert ends("10%, overall %")["minus usual"] == ("-10.0 [-10.0,-10.0]", "")
    assert any("insensitive on first sightings" in quote for quote in table.quotes)


def test_a_reference_is_compared_under_the_conditions_of_the_level(plays):
    lines = block(titled(plays, "confidence"), "10%, first sightings %")
    assert lines["minus history"] == ("+40.0 [40.0,40.0]", "+33.3 [33.3,33.3]")
    assert lines["care"] == ("60.0", "40.0")
    assert lines["minus usual"] == ("", "-20.0 [-20.0,-20.0]")
    assert lines["minus usual (paper)"] == ("", "-1.0")
    assert lines["minus random"]
    assert "minus random" not in block(titled(plays, "k_safe"), "10%, first sightings %")


def test_rows_of_before_tell_no_released_cells(plays):
    older = [{name: row[name] for name in row if name != "released"} for row in plays]
    one = [
        row if row["scene"] == SCENES[0].name else old
        for row, old in zip(plays, older, strict=True)
    ]
    for rows in (older, one):
        assert block(titled(rows, "k_safe"), "10%, first sightings %")["released"] == ("",) * 6


def test_the_closing_tells_what_the_full_scan_finds(plays):
    closing = STUDIES["ablate-open-loop"].closing(plays)
    assert closing[-1] == (
        "The full scan finds: first sightings 80.0%, below 20 m 90.0%, overall 90.0%."
    )
    assert closing[0].startswith("Scenes: 6, with 90 first sightings")
    without = [row for row in plays if row["policy"] != "full"]
    assert not any(
        "full scan" in sentence for sentence in STUDIES["ablate-open-loop"].closing(without)
    )


def test_all_that_the_paper_says_is_of_levels_and_bases_that_are_shown():
    shown = {
        (ablation.title, level.label, base)
        for ablation in OPEN_ABLATIONS
        for level in ablation.levels
        for base in (USUAL, *ablation.references)
    }
    assert {change[:3] for change in PUBLISHED_CHANGES} <= shown
