"""What the protocol's tables say of their intervals: over scenes, over events where scenes are few,
or none.
"""

from rich.console import Console

from care_sim.reports.latex import escaped
from care_sim.reports.protocol.closing import protocol_closing
from care_sim.reports.protocol.notes import BY_EVENTS, NO_INTERVAL
from care_sim.reports.protocol.tables import protocol_tables
from care_sim.reports.report import print_report, read_results, write_report
from care_sim.reports.studies import STUDIES
from care_sim.reports.table import Bold
from care_sim.study.results_formats import PLAYS
from care_sim.study.rows.parquet import write_rows
from tests.helpers.made_plays import found, play, study

BOTH = {"care": (6, 5), "history": (4, 6)}
CONTRASTS, EQUAL = "care minus each policy", "care minus each policy, equal scene weights"
STATEMENTS = "the paper's statements"


def tables(rows):
    return {table.title.rpartition(": ")[2]: table for table in protocol_tables(rows)}


def under(table, heading):
    """The line under a heading."""
    return table.rows[table.rows.index((heading,)) + 1]


def said_of_intervals(notes):
    return [note for note in notes if note in (BY_EVENTS, NO_INTERVAL)]


def three_with_events():
    """Of seven scenes three have events."""
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
    assert said_of_intervals(shown[STATEMENTS].notes) == [BY_EVENTS, NO_INTERVAL]


def test_the_closing_explains_the_mark_that_it_shows():
    _, gate, note = protocol_closing(three_with_events())
    assert "]° at 20% (met)" in gate
    assert note == BY_EVENTS
    assert note.startswith("°: fewer than 5 scenes")
    assert note.endswith("these drives alone.")


def test_intervals_over_scenes_have_no_mark_and_no_note():
    shown = tables(study(BOTH, scenes=5))
    assert "°" not in "".join(
        entry for table in shown.values() for row in table.rows for entry in row
    )
    assert said_of_intervals(note for table in shown.values() for note in table.notes) == []
    assert len(protocol_closing(study(BOTH, scenes=5))) == 2


def test_without_enough_events_either_the_note_says_why_there_is_no_interval():
    shown = tables(study({"care": (3, 5), "history": (1, 6)}, scenes=1, events=4))
    assert "°" not in "".join(entry for row in shown[CONTRASTS].rows for entry in row)


def test_the_mark_is_in_all_three_forms(tmp_path, capsys):
    protocol, rows = STUDIES["protocol"], three_with_events()
    write_report(rows, tmp_path, protocol)
    print_report(rows, Console(width=80), protocol)
    printed = capsys.readouterr().out
    markdown, latex = ((tmp_path / name).read_text() for name in ("tables.md", "tables.tex"))
    for text, plain in ((printed, str), (markdown, str), (latex, escaped)):
        assert plain("met° (+5.2)") in text
        assert plain(BY_EVENTS) in " ".join(text.split())
    assert "]°** |" in markdown
    assert r"]\textdegree{}} \\" in latex


def test_the_notes_tell_the_events_by_both_counts_where_the_rows_do():
    def note(**more):
        rows = study({"care": (5, 5), "history": (4, 5)}, scenes=6, events=20, **more)
        return next(note for note in tables(rows)[CONTRASTS].notes if "events" in note)

    assert note().endswith(
        "6 scenes, 120 events (42 emerging, 78 entering), 1,200 object frames; 3 floor seeds, "
        "averaged per scene."
    )
    assert note(emerging=2).endswith(
        "averaged per scene. 12 objects hidden within range at scene start are no event; presence "
        "visible counts them too, 132 in all."
    )
    assert note(emerging=2, presence="visible").endswith(
        "averaged per scene. Of the events, 12 are of objects that were hidden within range at "
        "scene start, which presence annotated does not count."
    )
    alone = protocol_closing([play("a", "full", [0], [1], emerging=1)])
    assert "1 object hidden within range at scene start is no event" in alone[0]


def test_what_a_folder_keeps_says_the_same_of_presence_and_emerging(tmp_path):
    for number, more in enumerate(({}, {"emerging": 2}, {"emerging": 2, "presence": "visible"})):
        rows = study({"care": (5, 5), "history": (4, 5)}, scenes=6, events=20, **more)
        (tmp_path / str(number)).mkdir()
        write_rows(rows, tmp_path / str(number) / PLAYS.file, "protocol")
        kept, protocol, _ = read_results(tmp_path / str(number))
        assert [str(table.markdown()) for table in protocol.tables(kept)] == [
            str(table.markdown()) for table in protocol_tables(rows)
        ]
        assert ("presence visible" in protocol.tables(kept)[0].title) == ("presence" in more)


def test_rows_of_which_some_do_not_tell_the_other_count_tell_none():
    rows = study({"care": (5, 5), "history": (4, 5)}, scenes=6, events=20, emerging=2)
    some = [row | {"emerging": None} if row["scene"] == "scene 001" else row for row in rows]
    assert "hidden within range" not in " ".join(tables(some)[CONTRASTS].notes)
