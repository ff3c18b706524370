"""First sightings by entry: plain, and as a share of what the full scan finds."""

import pytest
from care_sim.reports.protocol.entries import ENTRY_NOTE

from care_sim.evaluation.sightings import RANGE_M
from care_sim.evaluation.strata import ENTRIES, NEWCOMERS
from care_sim.reports.protocol.rows import plays_by_setting
from care_sim.reports.protocol.tables import protocol_tables
from care_sim.reports.report import read_results
from care_sim.study.results_formats import PLAYS
from care_sim.study.rows.parquet import write_rows
from tests.helpers.made_plays import found, play, study

NAME = "first-sighting recall by entry"
ROWS = study({"care": (6, 5), "history-oracle": (4, 6), "full": (8, 8)})


def tables(rows=ROWS):
    return {table.title.rpartition(": ")[2]: table for table in protocol_tables(rows)}


def test_recall_and_its_share_of_the_full_scans_by_entry():
    """Of 20 events a scene 7, 7 and 6 enter in turns, so that of 6 found at once each has 2."""
    table = tables()[NAME]
    assert table.columns == ("policy", "10%", "20%", "35%")
    assert table.rows[:4] == (
        ("emergence, 42 events",),
        ("care", *["28.6 (67 [67,67])"] * 3),
        ("history-oracle †", *["28.6 (67 [67,67])"] * 3),
        ("full", *["42.9"] * 3),
    )
    assert [line[0] for line in table.rows if len(line) == 1] == [
        "emergence, 42 events",
        "ring, 42 events",
        "beyond, 36 events",
    ]
    assert table.rows[6] == ("history-oracle †", *["14.3 (33 [33,33])"] * 3)
    assert table.notes[0].startswith("Levels in %; in brackets: of full. Of full: recall in % of")
    assert ENTRY_NOTE in table.notes
    assert any(note.startswith("†") for note in table.notes)


def test_the_note_tells_every_entry_and_its_bounds():
    assert all(f"{entry}: " in ENTRY_NOTE for entry in ENTRIES)
    assert "nearer than 45 m" in ENTRY_NOTE
    assert f"from 45 to {RANGE_M:.0f} m" in ENTRY_NOTE


def test_without_a_full_scan_there_is_no_line_of_it():
    names = [line[0] for line in tables(study({"care": (6, 5)}))[NAME].rows]
    assert names == ["emergence, 42 events", "care", "ring, 42 events", "care",
                     "beyond, 36 events", "care"]  # fmt: skip


def test_an_entry_that_no_object_took_has_no_block():
    """Two events a scene: the third entry has none."""
    rows = [play(f"{n}", policy, [0, 6], [1, 1]) for n in range(6) for policy in ("care", "full")]
    assert [line[0] for line in tables(rows)[NAME].rows if len(line) == 1] == [
        "emergence, 6 events",
        "ring, 6 events",
    ]
    assert NAME not in tables([play("a", "care", [], [])])


def test_care_is_compared_with_history_and_all_camera_by_entry():
    rows = study({"care": (6, 5), "history": (3, 5), "mine": (4, 5), "full": (8, 8)})
    table = tables(rows)[NAME]
    assert table.rows[5] == ("care minus history", *["+14.3 [14.3,14.3]"] * 3)
    assert [line[0] for line in table.rows[:6]] == [
        "emergence, 42 events", "care", "history", "mine", "full", "care minus history"
    ]  # fmt: skip
    assert "Differences in points." in table.notes


def test_an_entry_of_which_the_full_scan_finds_nothing_has_no_share():
    """Three events a scene, one an entry, of which the full scan finds the first."""
    rows = [
        play(f"{n}", policy, found(3, sighted), [1] * 3)
        for n in range(6)
        for policy, sighted in (("care", 2), ("full", 1))
    ]
    emergence, ring = (
        [*tables(rows)[NAME].rows].index((f"{entry}, 6 events",)) for entry in ENTRIES[:2]
    )
    lines = tables(rows)[NAME].rows
    assert lines[emergence + 1 : emergence + 3] == (
        ("care", "100.0 (100 [100,100])"),
        ("full", "100.0"),
    )
    assert lines[ring + 1 : ring + 3] == (("care", "100.0"), ("full", "0.0"))


def test_overall_recall_is_told_by_entry_too_and_first_sightings_are_not_told_twice():
    """Rows of real plays have the objects present at start as a stratum without an event."""
    start = {f"entry/at start/{name}": 0.0 for name in ("events", "sighted", "delay", "found")}
    shown = tables([row | start | {"entry/at start/frames": 4.0} for row in ROWS])
    first, overall = (shown[f"{name} recall by stratum"] for name in ("first-sighting", "overall"))
    assert not {line[0] for line in first.rows} & {"entry", *ENTRIES}
    assert {line[2] for line in overall.rows if line[0] == "at start"} == {"24"}
    assert ENTRY_NOTE not in first.notes
    assert ENTRY_NOTE in overall.notes


@pytest.mark.parametrize("number", [0, 6, -1])
def test_where_a_row_lacks_entries_nothing_is_told_by_entry(number):
    """The first of all, one of another seed, and one of the full scan."""
    old = {name: value for name, value in ROWS[number].items() if not name.startswith("entry/")}
    rows = [old if row is ROWS[number] else row for row in ROWS]
    shown = tables(rows)
    assert NAME not in shown
    kinds = [line[0] for line in shown["overall recall by stratum"].rows if len(line) == 1]
    assert kinds == ["range", "azimuth", "class"]


def test_a_borrowed_full_scan_without_entries_has_none_to_tell():
    late = study({"care": (6, 5)}, camera_latency=1)
    full = [
        {name: value for name, value in row.items() if not name.startswith("entry/")}
        for row in study({"full": (8, 8)})
    ]
    (borrowing,) = plays_by_setting([*late, *full])
    assert borrowing.full
    assert [*borrowing.strata()] == ["range", "azimuth", "class"]


def test_rows_of_before_there_were_entries_are_read_and_have_no_such_table(tmp_path):
    before = [
        {name: value for name, value in row.items() if not name.startswith("entry/")}
        for row in ROWS
    ]
    write_rows(before, tmp_path / PLAYS.file, "protocol", [], PLAYS.schema)
    kept, protocol, _ = read_results(tmp_path)
    shown = {table.title.rpartition(": ")[2]: table for table in protocol.tables(kept)}
    assert NAME not in shown
    strata = shown["overall recall by stratum"]
    assert [line[0] for line in strata.rows if len(line) == 1] == ["range", "azimuth", "class"]
    assert ENTRY_NOTE not in strata.notes
    now = tables()
    assert [*shown] == [name for name in now if name != NAME]
    kept = [
        n for n, name in enumerate(now["levels"].columns) if name.partition(" ")[0] not in NEWCOMERS
    ]
    assert shown["levels"].rows == tuple(
        tuple(line[n] for n in kept) for line in now["levels"].rows
    )
