"""The paper's statements against rows made by hand."""

import pytest

from care_sim.reports.studies import STUDIES
from care_sim.reports.table import Bold
from care_sim.reports.tables.paper_statements import statement_tables, statements
from care_sim.study.designs.paper import paper_study
from tests.helpers.made_rows import as_in_the_paper


def distance(config):
    """First detections as the paper has them."""
    if config.policy == "history":
        return 11.9
    return (
        10.3
        if (config.scenario, config.policy, config.budget) == ("dense", "all-camera", 0.03)
        else 15.1
    )


STUDY = [as_in_the_paper(config, distance(config)) for config in paper_study(range(5))]


def differing(rows):
    return [statement.text for statement in statements(rows) if not statement.agrees]


def changed(where, **values):
    return [row | values if where.items() <= row.items() else row for row in STUDY]


def test_the_closing_counts_what_holds_and_names_what_does_not():
    assert "The paper: 12 of 12 statements hold." in STUDIES["paper"].closing(STUDY)
    late = changed(DARTOUT | {"policy": "history"}, braked=True)
    told = "The paper: 11 of 12 statements hold. Not: dart-out 10%: history brakes in 3 of 5"
    assert any(line.startswith(told) for line in STUDIES["paper"].closing(late))
    assert not any("paper" in line for line in STUDIES["paper"].closing(STUDY[:10]))
    assert statement_tables(STUDY[:10]) == []


MISSED = {"detection_distance_m": None, "undetected_to_m": 3.0}
DARTOUT = {"scenario": "dartout", "budget": 0.1, "false_negative_rate": 0.0, "camera_latency": 0}


@pytest.mark.parametrize(
    ("where", "values", "text"),
    [
        (DARTOUT | {"policy": "care", "seed": 4}, {"braked": False}, "brake in every episode"),
        (DARTOUT | {"policy": "care"}, {"detection_distance_m": 14.5}, "within 0.3 m of full"),
        (DARTOUT | {"policy": "history"}, {"detection_distance_m": 13.5}, "at least 2 m later"),
        (DARTOUT | {"policy": "history"}, {"braked": True}, "brakes in 3 of 5"),
        (DARTOUT | {"policy": "all-camera"}, {"min_distance_m": 5.0}, "5.7 m or more"),
        (DARTOUT | {"policy": "history"}, {"min_distance_m": 5.5}, "history at 4.0 m"),
        (
            {"scenario": "dense", "policy": "full"},
            {"detection_distance_m": 16.0},
            "within 0.5 m of full",
        ),
        (
            {"scenario": "dense", "policy": "all-camera", "budget": 0.03},
            {"detection_distance_m": 13.0},
            "3 m later than care",
        ),
        (
            {"scenario": "dense", "policy": "care", "budget": 0.2},
            {"detection_distance_m": 16.0},
            "dense from 5%",
        ),
        ({"scenario": "cutin", "policy": "history"}, {"detection_distance_m": 18.0}, "cut-in"),
        ({"policy": "care", "false_negative_rate": 0.4}, MISSED, "missed detections"),
        ({"scenario": "dense", "policy": "care", "budget": 0.2}, MISSED, "dense from 5%"),
        ({"scenario": "cutin", "policy": "care"}, MISSED, "cut-in"),
        ({"policy": "care", "camera_latency": 2}, {"detection_distance_m": 9.0}, "latency"),
        ({"scenario": "cutin", "policy": "full", "seed": 0}, {"collision": True}, "collides"),
    ],
)
def test_each_statement_can_differ(where, values, text):
    (said,) = differing(changed(where, **values))
    assert text in said


def test_both_sides_are_shown():
    (table,) = statement_tables(STUDY)
    late = "dense 3%: all-camera detects at least 3 m later than care"
    assert table.rows[6] == (late, "10.3 against 15.1", "10.3 against 15.1", "agrees")
    (differs,) = statement_tables(changed(DARTOUT | {"policy": "history"}, braked=True))
    assert isinstance(differs.rows[3][3], Bold)
