"""The figure of every policy against the best control."""

import pytest

from care_sim.reports.figures.protocol import protocol_figures
from care_sim.reports.protocol.controls import over_controls
from care_sim.reports.protocol.rows import plays_by_setting
from tests.helpers.made_plays import found, play
from tests.reports.engine.test_controls import PLAYS

NAMED = (
    "Best control: in first-sighting recall place at 10% and rows at 20%; in overall recall rows "
    "at every budget."
)
UNEQUAL = [
    play(f"{n}", policy, found(20, sighted + n * gain), [5] * 20)
    for n in range(6)
    for policy, sighted, gain in (("care", 4, 2), ("rows", 3, 1))
]
"""Care is ahead by 1 to 6 of 20 events, scene by scene."""


def test_bars_reach_from_end_to_end_of_the_intervals():
    (measure, _) = over_controls(plays_by_setting(UNEQUAL)[0])
    ((difference,),) = measure.differences.values()
    mean, low, high = difference.interval
    assert low < mean - 1
    assert high > mean + 1
    first, _ = protocol_figures(UNEQUAL)["controls-streets"].axes
    (bar,) = first.collections
    assert bar.get_segments()[0][:, 1] == pytest.approx([low, high])


def test_the_figure_has_the_control_at_zero_and_a_curve_a_policy():
    figure = protocol_figures(PLAYS)["controls-streets"]
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


def test_without_a_control_or_a_measure_there_is_no_figure():
    untagged = [row | {"tags": None} for row in PLAYS]
    assert "controls-streets" not in protocol_figures(untagged)
    quiet = [
        row | dict.fromkeys(("events", "sighted", "delay"), 0.0) | {"ttfds": ()} for row in PLAYS
    ]
    (panel,) = protocol_figures(quiet)["controls-streets"].axes
    assert panel.get_title(loc="left") == "overall recall"
