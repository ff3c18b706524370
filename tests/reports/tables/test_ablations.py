"""Ablations of both loops on rows with known answers. The published rows hold the numbers."""

import pytest

from care_sim.reports.protocol.paper import PUBLISHED_CHANGES, USUAL
from care_sim.reports.studies import STUDIES
from care_sim.reports.table import Bold
from care_sim.reports.tables.ablations import ablation_tables
from care_sim.sources.scenes import Scene, Streets
from care_sim.study.designs.ablations import OPEN_ABLATIONS, ablation_plays, ablation_study
from tests.helpers.made_plays import found, play
from tests.helpers.made_rows import row


def titled(tables, part):
    (table,) = (table for table in tables if part in table.title)
    return table


def block(table, heading):
    """The lines under a heading by name, those of the paper apart."""
    start = table.rows.index((heading,)) + 1
    lines, name = {}, ""
    for line in table.rows[start:]:
        if len(line) == 1:
            break
        name = f"{name} (paper)" if line[0] == "(paper)" else line[0]
        lines[name] = line[1:]
    return lines


def distance(config):
    """CARE loses with a small reserve, history is late, the rest sees as far as the full scan."""
    if config.policy == "history":
        return 8.0
    return 10.0 if config.reserve_fraction == 0.15 and config.policy == "care" else 16.0


def test_a_level_is_compared_with_the_usual_one_and_with_others_at_its_level():
    configs = ablation_study(range(5), ["uncertainty", "care"])
    tags = {"uncertainty": "privileged"}
    tables = ablation_tables(
        [row(each, distance(each), tags=tags.get(each.policy, "causal")) for each in configs]
    )
    table = titled(tables, "reserve fraction rho")
    assert table.columns == ("", "0.15", "0.3 (usual)", "0.5")
    lines = block(table, "dartout, 3%, first detection m")
    assert lines["care"] == ("10.0", "16.0", "16.0")
    assert lines["minus usual"] == (Bold("-6.0* [-6.0,-6.0]"), "", "+0.0 [0.0,0.0]")
    assert lines["minus history"][:2] == ("+2.0 [2.0,2.0]", "+8.0* [8.0,8.0]")
    # A further policy stands beside the paper's where it feels the conditions.
    beside = ["minus uncertainty †" in {line[0] for line in each.rows} for each in tables]
    assert beside == [True] * 5 + [False] * 4


def outcome(config):
    """First sightings, object frames found of a near event and of another. Unguarded forgetting
    loses what is near, history finds little, a strict camera costs first sightings.
    """
    strict = config.camera_confidence == 0.5
    if config.policy == "full":
        return 12, 9, 9
    if config.policy == "history":
        return 1 if strict else 3, 6, 6
    if strict:
        return 6, 7, 7
    return 9, 4 if dict(config.policy_parameters).get("k_safe") == 0 else 7, 7


def made(config):
    sighted, near, other = outcome(config)
    given = {n: v for n, v in config.row().items() if n not in ("source", "scene", "policy")}
    # Events take turns in the strata, of which the first of range is the near field.
    frames = [near, other, other] * 5
    name = config.scene.name
    return play(name, config.policy, found(15, sighted), frames, released=24.0, **given)


@pytest.fixture(scope="module")
def plays():
    scenes = [Scene(f"street-{seed:04d}", seed) for seed in range(6)]
    configs = ablation_plays(Streets("evaluation"), scenes, [0.1, 0.2], ["random"])
    return [made(config) for config in configs]


def test_the_papers_figures_stand_beside_those_of_its_budgets(plays):
    table = titled(ablation_tables(plays), "k_safe")
    assert (table.columns[1], table.columns[-1]) == ("0", "2 (usual)")
    # A reference is compared under the conditions of the level.
    strict = block(titled(ablation_tables(plays), "confidence"), "10%, first sightings %")
    assert strict["minus history"] == ("+40.0 [40.0,40.0]", "+33.3 [33.3,33.3]")
    first = block(table, "10%, first sightings %")
    assert first["released (paper)"] == ("", "", "", "", "", "24")
    near = {budget: block(table, f"{budget}, below 20 m %") for budget in ("10%", "20%")}
    assert near["10%"]["care-sbf"] == ("40.0", *["70.0"] * 5)
    assert near["10%"]["minus usual"][0] == "-30.0 [-30.0,-30.0]"
    assert near["10%"]["minus care (paper)"][::5] == ("-1.8 [-2.9,-0.5]", "tied, -0.5 [-1.7,0.4]")
    assert near["20%"]["minus care (paper)"][::5] == ("", "-3.1 [-4.7,-1.5]")
    assert any("insensitive on first sightings" in quote for quote in table.quotes)


def test_released_cells_are_not_told_where_a_row_of_before_lacks_them(plays):
    rows = [
        {name: row[name] for name in row if name != "released" or row["scene"] == "street-0000"}
        for row in plays
    ]
    lines = block(titled(ablation_tables(rows), "k_safe"), "10%, first sightings %")
    assert lines["released"] == ("",) * 6


def test_the_closing_tells_what_the_full_scan_finds(plays):
    closing = STUDIES["ablate-open-loop"].closing
    told = "The full scan finds: first sightings 80.0%, below 20 m 90.0%, overall 90.0%."
    assert closing(plays)[-1] == told
    without = [row for row in plays if row["policy"] != "full"]
    assert not any("full scan" in sentence for sentence in closing(without))


def test_all_that_the_paper_says_is_of_levels_and_bases_that_are_shown():
    shown = {
        (ablation.title, level.label, base)
        for ablation in OPEN_ABLATIONS
        for level in ablation.levels
        for base in (USUAL, *ablation.references)
    }
    assert {change[:3] for change in PUBLISHED_CHANGES} <= shown
