"""Every policy against the best control that was played: which it is, by how much, in which tables
and figures.
"""

import pytest

from care_sim.reports.controls import best_control, is_control
from care_sim.reports.figures.protocol import protocol_figures
from care_sim.reports.page.protocol_charts import protocol_charts
from care_sim.reports.protocol.controls import RULE, control_at, controls, rivals
from care_sim.reports.protocol.rows import plays_by_setting
from care_sim.reports.protocol.tables import protocol_tables
from care_sim.reports.table import Bold
from tests.helpers.made_plays import study

AT_10 = {"care": (6, 5), "seed-finder": (9, 9), "rows": (4, 8), "place": (5, 3), "full": (8, 8)}
AT_20 = {"care": (6, 5), "seed-finder": (9, 9), "rows": (7, 6), "place": (5, 5)}
ROWS = [*study(AT_10, budgets=(0.1,)), *study(AT_20, budgets=(0.2,))]
NAME = "each policy minus the best control"


def tables(rows=ROWS):
    return {table.title.rpartition(": ")[2]: table for table in protocol_tables(rows)}


def plays(rows=ROWS):
    (one,) = plays_by_setting(rows)
    return one


@pytest.mark.parametrize(
    ("tags", "control"),
    [
        (("causal", "control"), True),
        (("control",), True),
        (("causal",), False),
        (("generator", "control"), False),
        (("privileged", "control"), False),
        (("non-causal", "control"), False),
        (("",), False),
    ],
)
def test_a_control_is_one_that_a_car_can_have(tags, control):
    assert is_control(tags) == control


def test_the_best_control_has_the_highest_level_and_of_equal_ones_is_the_first():
    assert best_control({"a": 1.0, "b": 3.0, "c": 3.0, "d": None}) == "b"
    assert best_control({"a": 0.0}) == "a"
    assert best_control({"a": None}) is None
    assert best_control({}) is None


def test_it_is_chosen_by_first_sightings_at_every_budget_whatever_its_overall_recall():
    assert controls(plays()) == ["rows", "place"]
    assert rivals(plays()) == ["care", "seed-finder"]
    assert [control_at(plays(), budget) for budget in (0.1, 0.2, 0.35)] == ["place", "rows", None]


def test_every_policy_is_held_against_the_control_of_its_own_budget():
    table = tables()[NAME]
    assert table.terminal
    assert table.columns == ("minus the best control", "10%", "20%")
    assert table.rows == (
        ("best control", "place", "rows"),
        ("First sightings",),
        ("care", "+5.0 [5.0,5.0]", "-5.0 [-5.0,-5.0]"),
        ("seed-finder §", "+20.0 [20.0,20.0]", "+10.0 [10.0,10.0]"),
        ("Overall recall",),
        ("care", "+20.0 [20.0,20.0]", "-10.0 [-10.0,-10.0]"),
        ("seed-finder §", "+60.0 [60.0,60.0]", "+30.0 [30.0,30.0]"),
    )
    assert isinstance(table.rows[2][1], Bold)
    assert RULE in table.notes
    assert "hindsight favours the control" in RULE
    assert list(tables()).index(NAME) < list(tables()).index("levels")


def test_without_a_control_or_another_policy_there_is_no_table():
    assert NAME not in tables(study({"care": (6, 5), "seed-finder": (9, 9), "full": (8, 8)}))
    assert NAME not in tables(study({"rows": (4, 8), "place": (5, 3), "full": (8, 8)}))
    untagged = [row | {"tags": None} for row in ROWS]
    assert NAME not in tables(untagged)
    assert "controls-streets" not in protocol_figures(untagged)


def test_a_budget_at_which_no_control_was_played_stays_empty():
    lone = [*ROWS, *study({"care": (6, 5)}, budgets=(0.35,))]
    assert [line[-1] for line in tables(lone)[NAME].rows if len(line) > 1] == [""] * 5


def test_the_figure_has_the_control_at_zero_and_a_curve_a_policy():
    figure = protocol_figures(ROWS)["controls-streets"]
    first, overall = figure.axes
    zero, *lines = [line for line in first.lines if not line.get_label().startswith("_")]
    assert (zero.get_label(), list(zero.get_ydata())) == ("best control", [0.0, 0.0])
    assert {line.get_label(): line.get_ydata() for line in lines} == {
        "care": pytest.approx([5.0, -5.0]),
        "seed-finder §": pytest.approx([20.0, 10.0]),
    }
    (care,) = (line for line in overall.lines if line.get_label() == "care")
    assert list(care.get_ydata()) == pytest.approx([20.0, -10.0])
    said = " ".join(figure.get_supxlabel().split())
    assert "Best control: place at 10%, rows at 20%." in said
    assert RULE in said


def test_the_page_has_the_same_chart():
    pytest.importorskip("altair")
    (chart,) = (each for each in protocol_charts(ROWS) if "best control" in each.title)
    assert "Best control: place at 10%, rows at 20%." in chart.notes[0]
    values = chart.spec["data"]["values"]
    assert [
        (value["panel"], value["policy"], value["control"], pytest.approx(value["value"]))
        for value in values
        if value["policy"] == "care"
    ] == [
        ("first-sighting recall", "care", "place", 5.0),
        ("first-sighting recall", "care", "rows", -5.0),
        ("overall recall", "care", "place", 20.0),
        ("overall recall", "care", "rows", -10.0),
    ]
    assert values[0]["text"] == "+5.0 [5.0,5.0]"
    assert not [each for each in protocol_charts(study(AT_20)[:24]) if "best" in each.title]
