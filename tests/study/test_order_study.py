from collections import Counter

import pytest

from care_sim.core.defaults import AS_DEMANDED
from care_sim.sources.scenes import Scene, Streets
from care_sim.study.designs.firing import (
    ORDERS,
    order_plays,
    order_study,
    rows_by_order,
    without_order,
)
from care_sim.study.designs.paper import paper_study

STREETS = Streets("evaluation")
SCENES = [Scene("street-0000", 0), Scene("street-0001", 1)]


def rows_of(configs):
    return [config.row() for config in configs]


def alike(rows):
    return Counter(tuple(sorted(row.items())) for row in rows)


def test_every_order_holds_the_papers_study_once():
    rows = rows_of(order_study([0]))
    assert len(rows) == 6 * 46 + 3
    by_order = rows_by_order(rows)
    assert tuple(by_order) == ORDERS
    paper = alike(rows_of(paper_study([0])))
    assert all(alike(own) == paper for own in by_order.values())


def test_the_full_scan_is_played_once_and_belongs_to_every_order():
    plays = order_plays(STREETS, SCENES, ["care", "full"], [0.03, 0.1], [0, 1])
    assert len(plays) == len(set(plays)) == 2 * (6 * 2 * 2 + 1)
    own = rows_by_order(rows_of(plays))["rows-up"]
    assert Counter(row["policy"] for row in own) == {"care": 8, "full": 2}
    assert {row["cell_order"] for row in own} == {AS_DEMANDED}


def test_patterns_are_played_once_and_belong_to_every_order():
    """History with rows asks for hulls: it feels the order."""
    plays = order_plays(STREETS, SCENES, ["rows", "history-rows"], [0.03, 0.1])
    assert len(plays) == len(set(plays)) == 2 * 2 * (1 + 6)
    assert len(order_study([0], ["fan"])) == len(order_study([0])) + 4 + 3 + 1 + 2 + 2
    for order, own in rows_by_order(rows_of(plays)).items():
        counts = Counter(row["policy"] for row in own)
        assert (order, counts) == (order, {"rows": 4, "history-rows": 4})
    assert without_order(rows_of(plays)) == ["rows"]


@pytest.mark.parametrize("kept", [("columns", "rows-down"), ("spread",)])
def test_orders_come_in_one_sequence_and_only_if_they_were_played(kept):
    rows = [row for row in rows_of(order_study([0])) if row["cell_order"] in kept]
    assert tuple(rows_by_order(rows[::-1])) == tuple(order for order in ORDERS if order in kept)
