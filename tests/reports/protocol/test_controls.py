"""Every policy against the best control that was played: which it is, by how much, in which tables
and figures.
"""

import pytest

from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL
from care_sim.reports.controls import best_control, is_control
from care_sim.reports.figures.protocol import protocol_figures
from care_sim.reports.protocol.controls import RULE, control_at, controls, over_controls, rivals
from care_sim.reports.protocol.rows import plays_by_setting
from care_sim.reports.protocol.tables import protocol_tables
from care_sim.reports.table import Bold
from tests.helpers.made_plays import found, play, study

AT_10 = {"care": (6, 5), "seed-finder": (9, 9), "rows": (4, 8), "place": (5, 3), "full": (8, 8)}
AT_20 = {"care": (6, 5), "seed-finder": (9, 9), "rows": (7, 6), "place": (5, 5)}
ROWS = [*study(AT_10, budgets=(0.1,)), *study(AT_20, budgets=(0.2,))]
NAME = "each policy minus the best control"
NAMED = (
    "Best control: in first-sighting recall place at 10% and rows at 20%; "
    "in overall recall rows at every budget."
)
UNEQUAL = [
    play(f"{n}", policy, found(20, sighted + n * gain), [5] * 20)
    for n in range(6)
    for policy, sighted, gain in (("care", 4, 2), ("rows", 3, 1))
]
"""Care is ahead by 1 to 6 of 20 events, scene by scene."""


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


def test_it_is_chosen_by_the_measure_itself_at_every_budget():
    assert controls(plays()) == ["rows", "place"]
    assert rivals(plays()) == ["care", "seed-finder"]
    chosen = {
        ratio: [control_at(plays(), ratio, budget) for budget in (0.1, 0.2, 0.35)]
        for ratio in (FIRST_SIGHTING, OVERALL)
    }
    assert chosen == {FIRST_SIGHTING: ["place", "rows", None], OVERALL: ["rows", "rows", None]}


def test_controls_are_compared_on_the_scenes_that_all_of_them_have():
    """`place` found less in the scene that both have; it was not played in the hard one."""
    sighted = {"care": (9, 1), "rows": (6, 0), "place": (5, None)}
    rows = [
        play(scene, policy, found(10, count), [count] * 10)
        for policy, counts in sighted.items()
        for scene, count in zip(("easy", "hard"), counts, strict=True)
        if count is not None
    ]
    levels = {each: plays(rows).level(FIRST_SIGHTING, each, 0.1).by_event for each in sighted}
    assert levels == {"care": 50.0, "rows": 30.0, "place": 50.0}
    assert control_at(plays(rows), FIRST_SIGHTING, 0.1) == "rows"
    assert control_at(plays(rows), OVERALL, 0.1) == "rows"
    apart = [row for row in rows if (row["policy"], row["scene"]) != ("rows", "easy")]
    assert control_at(plays(apart), FIRST_SIGHTING, 0.1) is None
    assert over_controls(plays(apart)) == []
    assert "scenes that all controls have" in RULE


def test_every_policy_is_held_against_the_control_of_its_own_budget():
    table = tables()[NAME]
    assert table.terminal
    assert table.columns == ("minus the best control", "10%", "20%")
    assert table.rows == (
        ("First sightings",),
        ("best control", "place", "rows"),
        ("care", "+5.0 [5.0,5.0]", "-5.0 [-5.0,-5.0]"),
        ("seed-finder §", "+20.0 [20.0,20.0]", "+10.0 [10.0,10.0]"),
        ("Overall recall",),
        ("best control", "rows", "rows"),
        ("care", "-30.0 [-30.0,-30.0]", "-10.0 [-10.0,-10.0]"),
        ("seed-finder §", "+10.0 [10.0,10.0]", "+30.0 [30.0,30.0]"),
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
    assert [line[-1] for line in tables(lone)[NAME].rows if len(line) > 1] == [""] * 6


def test_a_measure_of_which_there_is_nothing_has_no_panel_and_without_any_there_is_no_figure():
    """Scenes without an event have no first sightings; without object frames nothing at all."""
    quiet = [
        row | dict.fromkeys(("events", "sighted", "delay"), 0.0) | {"ttfds": ()} for row in ROWS
    ]
    assert [each.ratio for each in over_controls(plays(quiet))] == [OVERALL]
    (panel,) = protocol_figures(quiet)["controls-streets"].axes
    assert panel.get_title(loc="left") == "overall recall"
    assert ("First sightings",) not in tables(quiet)[NAME].rows
    empty = [row | dict.fromkeys(("frames", "found"), 0.0) for row in quiet]
    assert NAME not in tables(empty)
    assert "controls-streets" not in protocol_figures(empty)


def test_bars_reach_from_end_to_end_of_the_intervals():
    (measure, _) = over_controls(plays(UNEQUAL))
    ((difference,),) = measure.differences.values()
    mean, low, high = difference.interval
    assert low < mean - 1
    assert high > mean + 1
    first, _ = protocol_figures(UNEQUAL)["controls-streets"].axes
    (bar,) = first.collections
    assert bar.get_segments()[0][:, 1] == pytest.approx([low, high])


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
    assert list(care.get_ydata()) == pytest.approx([-30.0, -10.0])
    assert NAMED in " ".join(figure.get_supxlabel().split())
    others = [line for line in overall.lines if line.get_color() != care.get_color()]
    assert care.zorder > max(line.zorder for line in others)
