"""The paper's statements by order of cells, in both loops. The published rows hold the numbers."""

from care_sim.reports.studies import STUDIES
from care_sim.reports.table import Bold
from care_sim.reports.tables.order import order_closing, order_tables
from care_sim.study.designs.firing import ORDERS, order_study
from tests.helpers.made_plays import study
from tests.helpers.made_rows import as_in_the_paper

CONVERGE = "dense 3%: all-camera detects at least 3 m later than care"
CLAIM = "care minus history, first sightings, 10% (paper: +5.2)"


def distance(config):
    """The paper's own figures under most orders; from the bottom, all-camera is as early as CARE on
    the dense street.
    """
    if config.policy == "history":
        return 11.9
    collapsed = (config.scenario, config.policy, config.budget) == ("dense", "all-camera", 0.03)
    return 10.3 if collapsed and config.cell_order != "rows-up" else 15.1


ROWS = [as_in_the_paper(config, distance(config)) for config in order_study(range(5), ["fan"])]


def test_every_statement_has_a_verdict_under_every_order():
    verdicts, measured, levels, changes = order_tables(ROWS)
    assert verdicts.columns == ("statement", *ORDERS)
    assert len(verdicts.rows) == 12
    (changed,) = (row for row in verdicts.rows if "DIFFERS" in row)
    assert changed == (CONVERGE, *("DIFFERS" if o == "rows-up" else "agrees" for o in ORDERS))
    assert [isinstance(entry, Bold) for entry in changed[1:]] == [o == "rows-up" for o in ORDERS]
    (found,) = (row for row in measured.rows if row[0] == CONVERGE)
    assert found[1:3] == ("10.3 against 15.1", "15.1 against 15.1")
    assert "Each cell has at most 5 rows." in verdicts.notes
    assert order_closing(ROWS) == [
        "The paper: 11 of 12 statements have the same verdict under rows-down and rows-up."
    ]
    # A pattern has one level for all orders, and no differences.
    assert "Feel no order, played once: full, fan." in levels.notes
    fans = [row for row in levels.rows if row[0] == "fan"]
    assert len(fans) == 4 + 3 + 1 + 2 + 2
    assert all(len(set(row[2:])) == 1 for row in fans)
    assert not [row for row in changes.rows if row[0] in ("fan", "full")]


def test_one_order_or_a_part_of_the_study_has_no_statements_to_compare():
    up = [row for row in ROWS if row["cell_order"] == "rows-up" or row["policy"] == "full"]
    assert order_closing(up) == []
    assert all(row[2:] == ("",) for row in order_tables(up)[-1].rows if len(row) > 1)
    part = [row for row in ROWS if row["scenario"] == "dense"]
    assert len(order_tables(part)) == 2
    assert order_closing(part) == []


def test_statements_on_plays_are_judged_under_every_order():
    common = {"budgets": (0.03, 0.1), "seeds": (0,)}
    plays = [
        *study({"history": (4, 6), "care": (6, 5)}, cell_order="rows-down", **common),
        *study({"history": (6, 6), "care": (6, 7)}, cell_order="rows-up", **common),
        *study({"rows": (5, 4)}, **common),
        *study({"full": (9, 8)}),
    ]
    verdicts, measured, *_ = order_tables(plays)
    # A difference of exactly nothing bears no sign out.
    assert (CLAIM, "met", "undecided") in verdicts.rows
    assert (CLAIM, "+10.0 [10.0,10.0]", "+0.0 [0.0,0.0]") in measured.rows
    assert (
        "0 of 4 statements have the same verdict" in STUDIES["order-open-loop"].closing(plays)[-1]
    )
    assert len(order_tables([row for row in plays if row["budget"] in (0.03, 1.0)])) == 2
    assert order_tables([row for row in plays if row["policy"] == "full"]) == []
