"""Recalls and the paper's statements by order of cells, on plays with known answers."""

from care_sim.reports.protocol.order import order_closing, order_tables
from care_sim.reports.table import Bold
from tests.helpers.made_plays import study

DOWN = {"history": (4, 6), "care": (6, 5)}
UP = {"history": (6, 6), "care": (6, 7)}
UNORDERED = [
    *study({"rows": (5, 4)}, budgets=(0.03, 0.1), seeds=(0,)),
    *study({"full": (9, 8)}),
]
ROWS = [
    *study(DOWN, budgets=(0.03, 0.1), seeds=(0,), cell_order="rows-down"),
    *study(UP, budgets=(0.03, 0.1), seeds=(0,), cell_order="rows-up"),
    *UNORDERED,
]
CLAIM = "care minus history, first sightings, 10% (paper: +5.2)"


def tables(rows=ROWS):
    return {table.title.partition(": ")[2]: table for table in order_tables(rows)}


def test_recalls_stand_by_order_with_the_full_scan_beside():
    table = tables()["recall by order of cells, %"]
    assert table.columns == ("policy", "budget", "rows-down", "rows-up")
    first = table.rows[table.rows.index(("first-sighting recall",)) :]
    assert first[1:8] == (
        ("history", "3%", "20.0", "30.0"),
        ("care", "3%", "30.0", "30.0"),
        ("rows", "3%", "25.0", "25.0"),
        ("history", "10%", "20.0", "30.0"),
        ("care", "10%", "30.0", "30.0"),
        ("rows", "10%", "25.0", "25.0"),
        ("full", "100%", "45.0", "45.0"),
    )
    assert "Feel no order, played once: full, rows." in table.notes
    overall = table.rows[table.rows.index(("overall recall",)) :]
    assert overall[2] == ("care", "3%", "50.0", "70.0")


def test_differences_are_those_to_the_usual_order_scene_by_scene():
    table = tables()["recall by order of cells, minus rows-down, points"]
    assert table.columns == ("policy", "budget", "rows-up")
    line = table.rows[1]
    assert line == ("history", "3%", "+10.0 [10.0,10.0]")
    assert isinstance(line[2], Bold)
    assert {row[0] for row in table.rows if len(row) > 1} == {"history", "care"}


def test_the_papers_statements_are_judged_under_every_order():
    table = tables()["the paper's statements by order of cells"]
    (line,) = (row for row in table.rows if row[0] == CLAIM)
    # A difference of exactly nothing bears no sign out.
    assert line == (CLAIM, "met", "undecided")
    assert isinstance(line[2], Bold)
    assert all("3%" not in row[0] for row in table.rows)
    measured = tables()["the paper's statements by order of cells, what was measured"]
    assert (CLAIM, "+10.0 [10.0,10.0]", "+0.0 [0.0,0.0]") in measured.rows


def test_the_closing_counts_verdicts_that_both_numberings_share():
    assert order_closing(ROWS)[-1] == (
        "The paper: 0 of 4 statements have the same verdict under rows-down and rows-up."
    )
    alike = [*study(DOWN, cell_order="rows-down"), *study(DOWN, cell_order="rows-up"), *UNORDERED]
    assert order_closing(alike)[-1].startswith("The paper: 12 of 12 statements have the same")


def test_budgets_of_which_the_paper_says_nothing_have_no_statements():
    scarce = [row for row in ROWS if row["budget"] in (0.03, 1.0)]
    assert [*tables(scarce)] == [
        "recall by order of cells, %",
        "recall by order of cells, minus rows-down, points",
    ]


def test_the_full_scan_alone_makes_no_table():
    assert order_tables([row for row in ROWS if row["policy"] == "full"]) == []
