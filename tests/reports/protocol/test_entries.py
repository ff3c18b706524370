"""First sightings by entry: plain, and as a share of what the full scan finds."""

from care_sim.evaluation.sightings import RANGE_M
from care_sim.evaluation.strata import ENTRIES, RING_M
from care_sim.reports.protocol.entries import ENTRY_NOTE
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
    assert f"{RING_M:.0f} to {RANGE_M:.0f} m" in ENTRY_NOTE


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


def test_strata_list_entries_too_and_leave_out_those_with_nothing_to_find():
    """Rows of real plays have the objects present at start as a stratum without an event."""
    start = {f"entry/at start/{name}": 0.0 for name in ("events", "sighted", "delay", "found")}
    shown = tables([row | start | {"entry/at start/frames": 4.0} for row in ROWS])
    first, overall = (shown[f"{name} recall by stratum"] for name in ("first-sighting", "overall"))
    assert "at start" not in {line[0] for line in first.rows}
    assert {line[2] for line in overall.rows if line[0] == "at start"} == {"24"}
    assert ENTRY_NOTE in first.notes
    assert ENTRY_NOTE in overall.notes


def test_rows_of_before_there_were_entries_are_read_and_have_no_such_table(tmp_path):
    before = [
        {name: value for name, value in row.items() if not name.startswith("entry/")}
        for row in ROWS
    ]
    write_rows(before, tmp_path / PLAYS.file, "protocol", [], PLAYS.schema)
    kept, protocol, _ = read_results(tmp_path)
    shown = {table.title.rpartition(": ")[2]: table for table in protocol.tables(kept)}
    assert NAME not in shown
    strata = shown["first-sighting recall by stratum"]
    assert [line[0] for line in strata.rows if len(line) == 1] == ["range", "azimuth", "class"]
    assert ENTRY_NOTE not in strata.notes
    now = tables()
    assert [*shown] == [name for name in now if name != NAME]
    assert shown["levels"] == now["levels"]
