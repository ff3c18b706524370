"""Levels and the paper's statements by order of cells, in both loops, with known answers."""

import pytest

from care_sim.reports.studies import STUDIES
from care_sim.reports.table import Bold
from care_sim.reports.tables.order import order_closing, order_tables
from care_sim.study.designs.order import ORDERS, order_study
from tests.helpers.made_plays import study
from tests.helpers.made_rows import as_in_the_paper

VERDICTS, MEASURED, LEVELS, CHANGES = TITLES = (
    "The paper's statements by order of cells",
    "The paper's statements by order of cells, what was measured",
    "First detection by order of cells, median, m",
    "First detection by order of cells, minus rows-down, m",
)
CONVERGE = "dense 3%: all-camera detects at least 3 m later than care"


def distance(config):
    """The paper's own figures under most orders; from the bottom, all-camera is as early as CARE on
    the dense street.
    """
    if config.policy == "history":
        return 11.9
    collapsed = (config.scenario, config.policy, config.budget) == ("dense", "all-camera", 0.03)
    return 10.3 if collapsed and config.cell_order != "rows-up" else 15.1


ROWS = [as_in_the_paper(config, distance(config)) for config in order_study(range(5))]


@pytest.fixture(scope="module")
def tables():
    made = {table.title: table for table in order_tables(ROWS)}
    assert (*made,) == TITLES
    return made


def lines(table, *names):
    return [row for row in table.rows if row[: len(names)] == names]


def test_every_statement_has_a_verdict_under_every_order(tables):
    verdicts = tables[VERDICTS]
    assert verdicts.columns == ("statement", *ORDERS)
    assert len(verdicts.rows) == 12
    (changed,) = (row for row in verdicts.rows if "DIFFERS" in row)
    assert changed == (CONVERGE, *("DIFFERS" if o == "rows-up" else "agrees" for o in ORDERS))
    assert [isinstance(entry, Bold) for entry in changed[1:]] == [o == "rows-up" for o in ORDERS]
    (measured,) = lines(tables[MEASURED], CONVERGE)
    assert measured[1:3] == ("10.3 against 15.1", "15.1 against 15.1")
    assert "Each cell has at most 5 rows." in verdicts.notes


def test_detections_stand_under_their_setting_with_the_full_scan_in_every_column(tables):
    table = tables[LEVELS]
    street = table.rows[table.rows.index(("dense: First detection, m",)) + 1 :]
    assert street[1] == (
        "all-camera",
        "3%",
        *("15.1" if o == "rows-up" else "10.3" for o in ORDERS),
    )
    (full, *_) = [row for row in street if row[0] == "full"]
    assert full == ("full", "100%", *["15.1"] * len(ORDERS))
    assert sum(len(row) > 1 for row in table.rows) == 49


def test_differences_are_those_to_the_usual_order_seed_by_seed(tables):
    table = tables[CHANGES]
    assert lines(table, "full") == []
    camera = table.rows[table.rows.index(("dense: First detection, m",)) + 2]
    assert table.columns[2:4] == ("rows-up", "columns")
    assert camera[:4] == ("all-camera", "3%", "+4.8* [4.8,4.8]", "+0.0 [0.0,0.0]")
    assert isinstance(camera[2], Bold)


def test_a_pattern_has_one_level_for_all_orders_and_no_differences():
    rows = [as_in_the_paper(config, distance(config)) for config in order_study([0], ["fan"])]
    made = {table.title: table for table in order_tables(rows)}
    fans = lines(made[LEVELS], "fan")
    assert len(fans) == 4 + 3 + 1 + 2 + 2
    assert all(len(set(row[2:])) == 1 for row in fans)
    assert not [row for row in made[CHANGES].rows if row[0] in ("fan", "full")]
    assert "Feel no order, played once: full, fan." in made[LEVELS].notes


def test_the_closing_names_what_hangs_on_the_numbering():
    (sentence,) = order_closing(ROWS)
    assert sentence == (
        "The paper: 11 of 12 statements have the same verdict under rows-down and rows-up."
    )


def test_a_study_of_one_order_has_no_differences_and_no_closing():
    up = [row for row in ROWS if row["cell_order"] == "rows-up" or row["policy"] == "full"]
    assert order_closing(up) == []
    assert all(row[2:] == ("",) for row in order_tables(up)[-1].rows if len(row) > 1)


def test_a_part_of_the_papers_study_has_no_statements():
    part = [row for row in ROWS if row["scenario"] == "dense"]
    assert [table.title for table in order_tables(part)] == [LEVELS, CHANGES]
    assert order_closing(part) == []


DOWN = {"history": (4, 6), "care": (6, 5)}
UNORDERED = [
    *study({"rows": (5, 4)}, budgets=(0.03, 0.1), seeds=(0,)),
    *study({"full": (9, 8)}),
]
PLAYS = [
    *study(DOWN, budgets=(0.03, 0.1), seeds=(0,), cell_order="rows-down"),
    *study(
        {"history": (6, 6), "care": (6, 7)}, budgets=(0.03, 0.1), seeds=(0,), cell_order="rows-up"
    ),
    *UNORDERED,
]
CLAIM = "care minus history, first sightings, 10% (paper: +5.2)"


def of_plays(rows=PLAYS):
    return {table.title: table for table in order_tables(rows)}


def test_recalls_stand_by_order_with_the_full_scan_beside():
    table = of_plays()["Recall by order of cells, %"]
    assert table.columns == ("policy", "budget", "rows-down", "rows-up")
    assert sorted(table.rows[1:8]) == [
        ("care", "10%", "30.0", "30.0"),
        ("care", "3%", "30.0", "30.0"),
        ("full", "100%", "45.0", "45.0"),
        ("history", "10%", "20.0", "30.0"),
        ("history", "3%", "20.0", "30.0"),
        ("rows", "10%", "25.0", "25.0"),
        ("rows", "3%", "25.0", "25.0"),
    ]
    assert table.rows[8] == ("generated streets, detector returns: Overall recall",)
    assert ("care", "3%", "50.0", "70.0") in table.rows[8:]
    changes = of_plays()["Recall by order of cells, minus rows-down, points"]
    assert changes.rows[1] == ("history", "3%", Bold("+10.0 [10.0,10.0]"))
    assert {row[0] for row in changes.rows if len(row) > 1} == {"history", "care"}


def test_statements_on_plays_are_judged_under_every_order():
    (line,) = lines(of_plays()[VERDICTS], CLAIM)
    # A difference of exactly nothing bears no sign out.
    assert line == (CLAIM, "met", "undecided")
    assert isinstance(line[2], Bold)
    assert all("3%" not in row[0] for row in of_plays()[VERDICTS].rows)
    assert (CLAIM, "+10.0 [10.0,10.0]", "+0.0 [0.0,0.0]") in of_plays()[MEASURED].rows
    assert (
        "0 of 4 statements have the same verdict" in STUDIES["order-open-loop"].closing(PLAYS)[-1]
    )
    scarce = [row for row in PLAYS if row["budget"] in (0.03, 1.0)]
    assert VERDICTS not in of_plays(scarce)


def test_the_full_scan_alone_makes_no_table():
    assert order_tables([row for row in PLAYS if row["policy"] == "full"]) == []
