"""Tables of the protocol on plays with known answers, and the paper's numbers beside them."""

import pytest

from care_sim.evaluation.bootstrap import Interval
from care_sim.evaluation.scene_contrasts import OVERALL
from care_sim.reports.engine.contrasts import of_interval
from care_sim.reports.engine.measures import Recall
from care_sim.reports.findings import gate_tables
from care_sim.reports.protocol.formatting import claims_of_paper, judged, verdict
from care_sim.reports.protocol.paper import (
    PAPER_BUDGETS,
    PUBLISHED_LEVELS,
    Claim,
    Claims,
    claims_about,
)
from care_sim.reports.protocol.tables import protocol_tables
from care_sim.reports.table import Bold
from care_sim.study.rows.parquet import read_rows, with_tuples, write_rows
from care_sim.study.rows.reading import Setting
from tests.helpers.made_plays import found, play, study
from tests.reports.engine.test_controls import PLAYS

FOUND = {
    "history": (4, 6),
    "all-camera": (6, 5),
    "care": (6, 5),
    "mine": (5, 5),
    "history-oracle": (4, 6),
    "full": (8, 8),
}
ROWS = study(FOUND)
ENTRIES = "first-sighting recall by entry"


def tables(rows=ROWS):
    return {table.title.rpartition(": ")[2]: table for table in protocol_tables(rows)}


def block(table, heading):
    """The lines under a heading."""
    start = table.rows.index((heading,)) + 1
    stop = next(
        (n for n, row in enumerate(table.rows[start:], start) if len(row) == 1), len(table.rows)
    )
    return table.rows[start:stop]


def test_contrasts_stand_above_the_papers():
    assert list(tables())[:2] == ["care minus each policy", "each policy minus history"]
    table = tables()["care minus each policy"]
    assert table.columns == ("care minus", "10%", "20%", "35%")
    assert block(table, "First sightings") == (
        ("history", *["+10.0 [10.0,10.0]"] * 3),
        ("(paper)", "+5.2 [4.3,6.2]", "+5.2 [4.3,6.2]", "+4.3 [3.5,5.1]"),
        ("all-camera", *["+0.0 [0.0,0.0]"] * 3),
        ("(paper)", "tied", "tied", "tied"),
        ("mine", *["+5.0 [5.0,5.0]"] * 3),
        ("history-oracle †", *["+10.0 [10.0,10.0]"] * 3),
        ("(paper)", *["+3.7 to 4.7"] * 3),
    )
    bold = [isinstance(line[1], Bold) for line in block(table, "First sightings")]
    assert bold == [True, False, False, False, True, True, False]
    # Seven of 20 events per scene emerge; care sees 2 of them at once, and 4 of the 13 others.
    assert block(table, "First sightings, emerging")[0] == ("history", *["+0.0 [0.0,0.0]"] * 3)
    assert block(table, "First sightings, entering")[0] == ("history", *["+15.4 [15.4,15.4]"] * 3)
    assert block(table, "Overall recall")[0] == ("history", *["-10.0 [-10.0,-10.0]"] * 3)
    assert block(table, "Censored TTFD")[0] == ("history", *["-0.60 [-0.60,-0.60]"] * 3)
    counted = "6 scenes, 120 events (42 emerging, 78 entering), 1,200 object frames; 3 floor seeds"
    assert any(counted in note for note in table.notes)
    assert "†: knows the truth" in table.lines[-1]
    assert any(quote.startswith('Paper: "Table 1') for quote in table.quotes)


def test_every_policy_is_held_against_history_and_every_scene_weighs_alike_in_the_files():
    table = tables()["each policy minus history"]
    assert table.columns == ("minus history", "10%", "20%", "35%")
    assert block(table, "First sightings")[3:] == (
        ("mine", *["+5.0 [5.0,5.0]"] * 3),
        ("history-oracle †", *["+0.0 [0.0,0.0]"] * 3),
        ("(paper)", *["tied, at most 0.5"] * 3),
    )
    equal = tables()["care minus each policy, equal scene weights"]
    assert not equal.terminal
    assert block(equal, "First sightings, equal scenes")[1] == ("(paper)", "+5.3", "+5.2", "+4.2")


def test_levels_are_shares_of_what_the_full_scan_finds():
    table = tables()["levels"]
    lines = {(line[0], line[1]): line for line in table.rows}
    assert lines["20%", "care"][2:11] == (
        *("30.0", "75", "[75,75]", "28.6", "30.8", "50.0", "62", "[62,62]", "4.20"),
    )
    assert lines["20%", "care"][11:] == ("30.0", "50.0", "4.20", "0.0", "0.0", "6")
    assert lines["100%", "full"][2:5] == ("40.0", "100", "[100,100]")
    assert table.rows[-1][2:11] == ("24.5", "100", "", "", "", "49.4", "100", "", "")
    without = tables(study({"care": (6, 5)}))["levels"]
    assert without.rows[0][:7] == ("10%", "care", "30.0", "28.6", "30.8", "50.0", "4.20")
    assert without.notes[0] == "Of full: the full scan was not played."


@pytest.mark.parametrize(("scenes", "share"), [(4, ("50", "")), (5, ("45", "[25,65]"))])
def test_the_interval_of_a_share_rests_on_scenes_and_on_no_fewer_than_five(scenes, share):
    """In turns one and three of the four that the full scan finds."""
    rows = [
        play(f"{n}", policy, found(10, sighted), [sighted] * 10)
        for n in range(scenes)
        for policy, sighted in (("care", (1, 3)[n % 2]), ("full", 4))
    ]
    assert tables(rows)["levels"].rows[0][3:5] == share


def test_seeds_and_scenes_that_differ_are_told():
    rows = [
        play(f"{n}", "care", found(10, sighted), [sighted] * 10, floor_seed=seed)
        for n in range(2)
        for seed, sighted in enumerate((1, 2, 6))
    ]
    line = tables(rows)["levels"].rows[0]
    # The seed that is farthest from the mean of 30.
    assert (line[2], *line[-3:]) == ("30.0", "30.0", "30.0", "2")
    # The share of the ceiling is of the scenes that both have.
    rows = [play("a", "care", found(10, 2), [2] * 10), play("b", "care", found(10, 8), [8] * 10)]
    rows += [play("a", "full", found(10, 4), [4] * 10)]
    assert tables(rows)["levels"].rows[0][2:4] == ("50.0", "50")
    missing = ("scene 001", "mine", 0.2)
    lacking = [row for row in ROWS if (row["scene"], row["policy"], row["budget"]) != missing]
    note = "Scenes without a play, left out: mine 1 at 20%."
    shown = tables(lacking)
    assert shown["care minus each policy"].notes[0].endswith(note)
    assert note in shown["levels"].notes


def test_statements_are_judged_at_the_papers_budgets():
    table = tables()["the paper's statements"]
    lines = {line[0]: line[1::2] for line in block(table, "First sightings")}
    met = ("+10.0 met (+5.2)", "+10.0 met (+5.2)", "+10.0 met (+4.3)")
    assert lines["care minus history"] == met
    assert lines["history-oracle minus history"] == ("+0.0 met (tied)",) * 3
    overall = {line[0]: line for line in block(table, "Overall recall")}
    assert overall["care minus history"][5:] == ("-10.0 not met (+0.6)", "[-10.0,-10.0]")
    assert overall["care minus all-camera"][1] == "+0.0 undecided (-0.13)"
    assert table.notes[0].startswith("27 verdicts")
    assert table.notes[0].endswith("20 met, 1 not met, 6 undecided.")
    assert "the paper's statements" not in tables(study(FOUND, budgets=(0.05,)))
    assert "the paper's statements" not in tables(study(FOUND, reserve_fraction=0.5))


@pytest.mark.parametrize(
    ("ends", "scenes", "verdicts"),
    [
        ((1, 0.5, 2), 5, ("met", "not met", "not met")),
        ((-1, -2, -0.5), 5, ("not met", "met", "not met")),
        ((0.2, -1, 1), 5, ("undecided", "undecided", "met")),
        ((1, 0.5, 2), 4, ("undecided",) * 3),
    ],
)
def test_the_rule_of_met(ends, scenes, verdicts):
    difference = of_interval(Recall(OVERALL), Interval(*ends), scenes)
    assert tuple(verdict(difference, claimed) for claimed in (1, -1, 0)) == verdicts


def test_every_claim_of_the_paper_has_the_sign_of_its_numbers_at_its_budgets():
    for claims in claims_about(Setting("streets", detector="returns")).values():
        assert {*claims.by_budget} <= {*PAPER_BUDGETS}
        for claim in claims.by_budget.values():
            assert not claim.sign or claim.mean is None or claim.mean * claim.sign > 0
            assert claim.ends is None or claim.ends[0] < claim.mean < claim.ends[1]
            assert claim.ends is None or (claim.ends[0] > 0) - (claim.ends[1] < 0) == claim.sign
    assert {budget for _, budget in PUBLISHED_LEVELS} == {*PAPER_BUDGETS, 1.0}


@pytest.mark.parametrize(
    ("claim", "text", "short"),
    [
        (Claim(-1, -0.13, (-0.26, -0.01)), "-0.13 [-0.26,-0.01]", "-0.13"),
        (Claim(1, 3.7, upper=4.7), "+3.7 to 4.7", "+3.7 to 4.7"),
        (Claim(-1), "below", "below"),
        (Claim(0, at_most=0.5), "tied, at most 0.5", "tied"),
        (Claim(0, -0.5, (-1.7, 0.4)), "tied, -0.5 [-1.7,0.4]", "tied"),
    ],
)
def test_claims_are_printed_as_the_paper_has_them(claim, text, short):
    claims = Claims({0.1: claim}, "")
    assert claims_of_paper(claims, (0.1, 0.2)) == (text, "")
    assert claims_of_paper(claims, (0.2,)) == ()
    ours = of_interval(Recall(OVERALL), Interval(1.0, 0.5, 1.5), 5)
    assert judged(ours, claim).endswith(f" ({short})")


def test_the_strict_causal_variant_has_the_papers_own_numbers():
    late = study({"care": (6, 5), "history": (4, 6)}, camera_latency=1)
    shown = {table.title: table for table in protocol_tables([*ROWS, *late])}
    title = (
        "generated streets, detector returns, strict-causal (camera one keyframe old): "
        "care minus each policy"
    )
    assert shown[title].rows[2] == ("(paper)", "+4.6", "+5.3", "+2.6")
    # The full scan of the plain setting is the ceiling of this one, too.
    levels = shown[title.replace("care minus each policy", "levels")]
    assert [line[3] for line in levels.rows if line[1] == "care"] == ["75"] * 3


def test_strata_have_the_level_of_every_policy_and_contrasts():
    table = tables()["first-sighting recall by stratum"]
    kinds = [line[0].partition(":")[0] for line in table.rows if len(line) == 1]
    assert [*dict.fromkeys(kinds)] == ["range", "azimuth", "class"]
    side = {line[0]: line[1] for line in block(table, "azimuth: side, 42 events")}
    assert side == {
        "history": "14.3",
        "all-camera": "28.6",
        "care": "28.6",
        "mine": "28.6",
        "history-oracle †": "14.3",
        "full": "42.9",
        "care minus history": "+14.3 [14.3,14.3]",
        "care minus all-camera": "+0.0 [0.0,0.0]",
    }
    assert block(tables()["overall recall by stratum"], "azimuth: side, 420 object frames")


def test_differing_allocations_stand_above_the_papers():
    table = tables()["keyframes on which the allocation differs from that of care"]
    assert table.rows[1:3] == (
        ("all-camera", *["10%, 50 cells"] * 3),
        ("(paper)", "17%", "", "68%"),
    )


def test_the_gain_is_held_against_the_papers_gate_at_the_papers_budgets():
    (small,) = gate_tables(study({"care": (5, 5), "history": (4, 5)}, events=25, budgets=(0.1,)))
    assert small.rows[0][-3:] == ("+4.0", "[4.0,4.0]", "no")
    (behind,) = gate_tables(study({"care": (4, 6), "history": (12, 6)}, budgets=(0.1,)))
    assert behind.rows[0][-1] == "history"
    assert gate_tables(study({"care": (5, 5)})) == []
    assert gate_tables(study({"care": (6, 5), "history": (4, 6)}, budgets=(0.05,))) == []


def test_a_file_changes_nothing_in_the_tables(tmp_path):
    rows = [*ROWS, play("empty", "care", [], []), play("empty", "history", [], [])]
    write_rows(rows, tmp_path / "plays.parquet", "protocol")
    read = read_rows(tmp_path / "plays.parquet")
    assert [with_tuples(row) for row in read] == read
    assert protocol_tables(read) == protocol_tables(rows)


def test_every_policy_is_held_against_the_control_of_its_own_budget():
    table = tables(PLAYS)["each policy minus the best control"]
    assert table.rows[:4] == (
        ("First sightings",),
        ("best control", "place", "rows"),
        ("care", "+5.0 [5.0,5.0]", "-5.0 [-5.0,-5.0]"),
        ("seed-finder §", "+20.0 [20.0,20.0]", "+10.0 [10.0,10.0]"),
    )
    assert isinstance(table.rows[2][1], Bold)
    assert "Candidates: rows, place." in table.notes[0]
    for played in ({"care": (6, 5), "full": (8, 8)}, {"rows": (4, 8), "place": (5, 3)}):
        assert "each policy minus the best control" not in tables(study(played))


def test_recall_and_its_share_of_the_full_scans_by_entry():
    """Two events a scene, of which the full scan finds the first: the third entry has none."""
    rows = [
        play(f"{n}", policy, found(2, sighted), [1, 1])
        for n in range(6)
        for policy, sighted in (("care", 2), ("history", 1), ("full", 1))
    ]
    table = tables(rows)[ENTRIES]
    assert table.rows == (
        ("entry: emergence, 6 events",),
        ("care", "100.0 (100 [100,100])"),
        ("history", "100.0 (100 [100,100])"),
        ("full", "100.0"),
        ("care minus history", "+0.0 [0.0,0.0]"),
        ("entry: ring, 6 events",),
        ("care", "100.0"),
        ("history", "0.0"),
        ("full", "0.0"),
        ("care minus history", "+100.0 [100.0,100.0]"),
    )
    assert "nearer than 45 m, ring up to 50 m" in table.notes[0]


@pytest.mark.parametrize("number", [0, -1])
def test_where_a_row_lacks_entries_nothing_is_told_by_entry(number):
    """The first of all, and one of the full scan."""
    old = {name: value for name, value in ROWS[number].items() if not name.startswith("entry/")}
    shown = tables([old if row is ROWS[number] else row for row in ROWS])
    assert ENTRIES not in shown
    assert not any("entry" in line[0] for line in shown["overall recall by stratum"].rows)
    assert not any("emerging" in name for name in shown["levels"].columns)


def test_events_earlier_than_history_are_counted_where_a_source_has_no_labels():
    delays = {
        ("history", 0): [0, 3, 6, 6],
        ("history", 1): [0, 3, 6, 6],
        ("care", 0): [0, 1, 6, 4],
        ("care", 1): [1, 1, 6, 4],
    }
    rows = [
        play("one", policy, each, [5] * 4, source="sweeps", floor_seed=seed)
        for (policy, seed), each in delays.items()
    ]
    first = protocol_tables(rows)[0]
    assert first.columns == ("budget", "policy", "earlier", "later", "tied")
    assert first.rows == (("10%", "care", "2.0", "0.5", "1.5"),)
    labelled = protocol_tables([row | {"source": "nuscenes"} for row in rows])
    assert not any("earlier, later" in table.title for table in labelled)
