"""The notes of the protocol's tables: intervals over scenes, over events where scenes are few, or
none, and how much was played.
"""

from care_sim.reports.findings import gate_tables
from care_sim.reports.protocol.formatting import protocol_closing
from care_sim.reports.protocol.tables import protocol_tables
from care_sim.reports.report import read_results
from care_sim.reports.table import Bold
from care_sim.study.results_formats import PLAYS
from care_sim.study.rows.parquet import write_rows
from tests.helpers.made_plays import found, play, study

BOTH = {"care": (6, 5), "history": (4, 6)}
CONTRASTS = "care minus each policy"
STATEMENTS = "the paper's statements"


def tables(rows):
    return {table.title.rpartition(": ")[2]: table for table in protocol_tables(rows)}


def under(table, heading):
    """The line under a heading."""
    return table.rows[table.rows.index((heading,)) + 1]


def three_with_events():
    """Three of seven scenes have events."""
    return [
        play(f"{n}", policy, found(events, min(sighted, events)), [sighted] * events, budget=0.2)
        for n, events in enumerate([10] * 3 + [0] * 4)
        for policy, sighted in (("care", 9), ("history", 1))
    ]


def test_what_rests_on_an_interval_over_events_is_marked_and_explained():
    shown = tables(three_with_events())
    sightings = under(shown[CONTRASTS], "First sightings")[1]
    assert isinstance(sightings, Bold)
    assert (sightings[:7], sightings[-2:]) == ("+80.0 [", "]°")
    assert under(shown[CONTRASTS], "Censored TTFD")[1].endswith("]°")
    assert under(shown[CONTRASTS], "Overall recall")[1] == "+80.0"
    judgement, interval = under(shown[STATEMENTS], "First sightings")[1:]
    assert (judgement, interval[-2:]) == ("+80.0 met° (+5.2)", "]°")
    (gate,) = gate_tables(three_with_events())
    assert gate.rows[0][5:] == ("+80.0", interval, "care")
    for table in (shown[CONTRASTS], shown[STATEMENTS], gate):
        assert "°: interval over events" in table.lines[-1]


def test_the_closing_counts_events_by_both_presences_where_the_rows_do():
    def closing(**more):
        (told,) = protocol_closing(study(BOTH, scenes=6, events=20, **more))
        return told

    assert closing() == (
        "Scenes: 6, with 120 first sightings and 1,200 object frames in 240 keyframes; plays: 108."
    )
    assert closing(emerging=2).endswith(". Presence visible counts 12 more events, 132 in all.")
    visible = closing(emerging=2, presence="visible")
    assert visible.endswith(". Presence annotated does not count 12 of them.")
    rows = study(BOTH, scenes=6, events=20, emerging=2)
    some = [row | {"emerging": None} if row["scene"] == "scene 001" else row for row in rows]
    assert "resence" not in protocol_closing(some)[0]


def test_what_a_folder_keeps_says_the_same_of_presence_and_emerging(tmp_path):
    for number, more in enumerate(({}, {"emerging": 2}, {"emerging": 2, "presence": "visible"})):
        rows = study(BOTH, scenes=6, events=20, **more)
        (tmp_path / str(number)).mkdir()
        write_rows(rows, tmp_path / str(number) / PLAYS.file, "protocol")
        kept, protocol, _ = read_results(tmp_path / str(number))
        assert protocol.tables(kept) == protocol.tables(rows)
        assert ("presence visible" in protocol_tables(kept)[0].title) == ("presence" in more)
