"""The open loop's ablations on plays with known answers, and the paper's figures beside them."""

import pytest

from care_sim.reports.protocol.ablations import ablation_closing, ablation_tables
from care_sim.reports.protocol.paper_ablations import PUBLISHED_CHANGES, USUAL
from care_sim.reports.table import Bold
from care_sim.sources.scenes import Scene, Streets
from care_sim.study.designs.ablations import OPEN_ABLATIONS, ablation_plays
from tests.helpers.made_plays import found, play

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
def rows():
    return [made(config) for config in ablation_plays(STREETS, SCENES, [0.1, 0.2], ["random"])]


def block(table, heading):
    start = table.rows.index((heading,)) + 1
    stop = next(
        (n for n, row in enumerate(table.rows[start:], start) if len(row) == 1), len(table.rows)
    )
    return table.rows[start:stop]


def titled(rows, part):
    (table,) = (table for table in ablation_tables(rows) if part in table.title)
    return table


def test_every_ablation_has_its_table_with_all_levels_at_every_budget(rows):
    tables = ablation_tables(rows)
    assert len(tables) == len(OPEN_ABLATIONS) == 11
    for table, ablation in zip(tables, OPEN_ABLATIONS, strict=True):
        for budget in ("10%", "20%"):
            lines = block(table, f"{budget}, minus the usual level")
            levels = [line for line in lines if line[0] != "(paper)"]
            assert [line[0].removesuffix(" (usual)") for line in levels] == [
                level.label for level in ablation.levels
            ]
            assert sum("(usual)" in line[0] for line in levels) == 1
            assert all(line[1] and line[3] and line[5] and line[7] for line in levels)
            assert all(bool(line[2]) != ("(usual)" in line[0]) for line in levels)


def test_near_field_and_released_cells_stand_beside_the_papers(rows):
    table = titled(rows, "k_safe")
    usual = block(table, "10%, minus the usual level")
    assert usual[0] == (
        "0",
        "60.0",
        "+0.0 [0.0,0.0]",
        "40.0",
        "-30.0 [-30.0,-30.0]",
        "60.0",
        "-10.0 [-10.0,-10.0]",
        "60",
    )
    assert isinstance(usual[0][4], Bold)
    assert any("insensitive on first sightings" in quote for quote in table.quotes)
    assert usual[-2:] == (
        ("2 (usual)", "60.0", "", "70.0", "", "70.0", "", "24"),
        ("(paper)", "", "", "", "", "", "", "24"),
    )
    care = block(table, "10%, minus care")
    assert care[0] == (
        *("0", "", "+0.0 [0.0,0.0]", "", "-30.0 [-30.0,-30.0]"),
        *("", "-10.0 [-10.0,-10.0]", ""),
    )
    assert care[1] == ("(paper)", "", "", "", "-1.8 [-2.9,-0.5]", "", "", "")
    assert care[-1] == ("(paper)", "", "", "", "tied, -0.5 [-1.7,0.4]", "", "", "")
    assert block(table, "20%, minus care")[-1][4] == "-3.1 [-4.7,-1.5]"


def test_a_reference_is_compared_under_the_conditions_of_the_level(rows):
    table = titled(rows, "confidence")
    history = block(table, "10%, minus history")
    assert [line[2] for line in history] == ["+40.0 [40.0,40.0]", "+33.3 [33.3,33.3]"]
    assert block(table, "10%, minus the usual level")[1:] == (
        ("0.5", "40.0", "-20.0 [-20.0,-20.0]", *["70.0", "+0.0 [0.0,0.0]"] * 2, "0"),
        ("(paper)", "", "-1.0", "", "", "", "", ""),
    )
    assert block(table, "10%, minus random")


def test_a_further_policy_stands_only_where_conditions_vary(rows):
    assert not any("random" in line[0] for line in titled(rows, "k_safe").rows)


def test_rows_of_before_tell_no_released_cells(rows):
    older = [{name: row[name] for name in row if name != "released"} for row in rows]
    lines = block(titled(older, "k_safe"), "10%, minus the usual level")
    assert [line[7] for line in lines if line[0] != "(paper)"] == [""] * 6
    one = [
        row if row["scene"] == SCENES[0].name else old for row, old in zip(rows, older, strict=True)
    ]
    assert titled(one, "k_safe") == titled(older, "k_safe")


def test_the_closing_tells_what_the_full_scan_finds(rows):
    closing = ablation_closing(rows)
    assert closing[-1] == (
        "The full scan finds: first sightings 80.0%, below 20 m 90.0%, overall 90.0%."
    )
    assert closing[0].startswith("Scenes: 6, with 90 first sightings")
    without = [row for row in rows if row["policy"] != "full"]
    assert not any("full scan" in sentence for sentence in ablation_closing(without))


def test_all_that_the_paper_says_is_of_levels_and_bases_that_are_shown():
    shown = {
        (ablation.title, level.label, base)
        for ablation in OPEN_ABLATIONS
        for level in ablation.levels
        for base in (USUAL, *ablation.references)
    }
    assert {change[:3] for change in PUBLISHED_CHANGES} <= shown
