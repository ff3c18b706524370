"""The paper's closed-loop study by order of cells, on rows made by hand."""

import pytest

from care_sim.reports.table import Bold
from care_sim.reports.tables.order import order_closing, order_tables
from care_sim.study.designs.order import ORDERS, order_study
from tests.helpers.made_rows import as_in_the_paper

TITLES = (
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
    made = order_tables(ROWS)
    assert tuple(table.title for table in made) == TITLES
    return dict(zip(TITLES, made, strict=True))


def lines(table, *names):
    return [row for row in table.rows if row[: len(names)] == names]


def test_every_statement_has_a_verdict_under_every_order(tables):
    verdicts = tables[TITLES[0]]
    assert verdicts.columns == ("statement", *ORDERS)
    assert len(verdicts.rows) == 12
    (changed,) = (row for row in verdicts.rows if "DIFFERS" in row)
    assert changed == (CONVERGE, *("DIFFERS" if o == "rows-up" else "agrees" for o in ORDERS))
    assert [isinstance(entry, Bold) for entry in changed[1:]] == [o == "rows-up" for o in ORDERS]
    (measured,) = lines(tables[TITLES[1]], CONVERGE)
    assert measured[1:3] == ("10.3 against 15.1", "15.1 against 15.1")


def test_verdicts_say_how_many_episodes_they_rest_on(tables):
    for title in TITLES[:2]:
        assert "Of each cell 5 episodes; the paper has 5." in tables[title].notes
    single = order_tables([row for row in ROWS if row["seed"] == 0])
    assert "Of each cell 1 episode; the paper has 5." in single[0].notes


def test_detections_stand_under_their_setting_with_the_full_scan_in_every_column(tables):
    table = tables[TITLES[2]]
    start = table.rows.index(("dense",))
    assert table.rows[start + 1 :][1] == (
        "all-camera",
        "3%",
        *("15.1" if o == "rows-up" else "10.3" for o in ORDERS),
    )
    (full, *_) = [row for row in table.rows[start:] if row[0] == "full"]
    assert full == ("full", "100%", *["15.1"] * len(ORDERS))
    assert sum(len(row) > 1 for row in table.rows) == 49


def test_differences_are_those_to_the_usual_order_seed_by_seed(tables):
    table = tables[TITLES[3]]
    assert lines(table, "full") == []
    start = table.rows.index(("dense",))
    camera = table.rows[start + 2]
    assert table.columns[2:4] == ("rows-up", "columns")
    assert camera[:4] == ("all-camera", "3%", "+4.8* [4.8,4.8]", "+0.0 [0.0,0.0]")
    assert isinstance(camera[2], Bold)


def test_a_pattern_has_one_level_for_all_orders_and_no_differences():
    rows = [as_in_the_paper(config, distance(config)) for config in order_study([0], ["fan"])]
    made = {table.title: table for table in order_tables(rows)}
    fans = [row for row in made[TITLES[2]].rows if row[0] == "fan"]
    assert len(fans) == 4 + 3 + 1 + 2 + 2
    assert all(len(set(row[2:])) == 1 for row in fans)
    assert not [row for row in made[TITLES[3]].rows if row[0] in ("fan", "full")]
    assert "Feel no order, played once: full, fan." in made[TITLES[3]].notes


def test_the_closing_names_what_hangs_on_the_numbering():
    (sentence,) = order_closing(ROWS)
    assert sentence == (
        "The paper: 11 of 12 statements have the same verdict under rows-down and rows-up."
    )


def test_a_study_of_one_order_has_no_differences_and_no_closing():
    up = [row for row in ROWS if row["cell_order"] == "rows-up" or row["policy"] == "full"]
    assert order_closing(up) == []
    changes = order_tables(up)[-1]
    assert all(row[2:] == ("",) for row in changes.rows if len(row) > 1)


def test_a_part_of_the_papers_study_has_no_statements():
    part = [row for row in ROWS if row["scenario"] == "dense"]
    assert [table.title for table in order_tables(part)] == list(TITLES[2:])
    assert order_closing(part) == []
