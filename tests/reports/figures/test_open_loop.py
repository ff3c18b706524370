"""Figures of plays: levels against the budget, differences to the best control, orders of cells."""

from fnmatch import fnmatch

import pytest

from care_sim.reports.figures.open_loop import open_order_figures, protocol_figures
from care_sim.reports.protocol.contrasts import over_controls
from care_sim.reports.protocol.rows import plays_by_setting
from care_sim.reports.studies import STUDIES
from care_sim.study.designs.firing import ORDERS
from tests.helpers.drawn import heights, titles
from tests.helpers.made_plays import found, play, study
from tests.reports.engine.test_controls import PLAYS

FOUND = {
    "history": (4, 6),
    "care": (6, 5),
    "beam-reduce": (5, 2),
    "history-oracle": (7, 7),
    "full": (8, 8),
}
ROWS = study(FOUND)
UNEQUAL = [
    play(f"{n}", policy, found(20, sighted + n * gain), [5] * 20)
    for n in range(6)
    for policy, sighted, gain in (("care", 4, 2), ("rows", 3, 1))
]
"""Care is ahead by 1 to 6 of 20 events, scene by scene."""


def test_every_setting_has_its_figure_and_their_names_are_known():
    rows = [
        *ROWS,
        *study(FOUND, camera_latency=1),
        *study(FOUND, camera_latency=2, budgets=(0.1,)),
        *study({"full": (8, 8)}, source="nuscenes"),
    ]
    figures = protocol_figures(rows)
    assert list(figures) == ["levels-streets", "levels-streets-camera-latency-1"]
    patterns = STUDIES["protocol"].figures_of()
    assert all(any(fnmatch(name, pattern) for pattern in patterns) for name in figures)
    assert not any(fnmatch("levels-mine", pattern) for pattern in patterns)
    own = STUDIES["protocol"].figures_of([row | {"source": "mine:Film"} for row in rows])
    assert any(fnmatch("levels-mine-Film", pattern) for pattern in own)


def test_levels_have_a_line_a_policy_the_full_scan_and_what_the_paper_reports():
    first, overall = protocol_figures(ROWS)["levels-streets"].axes
    assert heights(first) == {
        "full scan": [40.0] * 3,
        "history": [20.0] * 3,
        "care": [30.0] * 3,
        "beam-reduce": [25.0] * 3,
        "history-oracle †": [35.0] * 3,
    }
    assert heights(overall)["full scan"] == [80.0] * 3
    said = [line for line in overall.lines if line.get_label() == "_paper"]
    assert [list(line.get_ydata()) for line in said if line.get_linestyle() == ":"] == [[49.4] * 3]
    diamonds = [list(line.get_ydata()) for line in said if line.get_marker() == "D"]
    assert [pytest.approx(0.94 * 49.4)] in diamonds
    strict = [row | {"camera_latency": 1} for row in ROWS]
    (panel, _) = protocol_figures(strict)["levels-streets-camera-latency-1"].axes
    assert "_paper" not in {line.get_label() for line in panel.lines}


def test_bars_reach_from_end_to_end_of_the_intervals():
    (measure, _) = over_controls(plays_by_setting(UNEQUAL)[0])
    ((difference,),) = measure.differences.values()
    mean, low, high = difference.interval
    assert low + 1 < mean < high - 1
    (bar,) = protocol_figures(UNEQUAL)["controls-streets"].axes[0].collections
    assert bar.get_segments()[0][:, 1] == pytest.approx([low, high])


def test_the_figure_has_the_control_at_zero_and_a_curve_a_policy():
    figure = protocol_figures(PLAYS)["controls-streets"]
    first, overall = figure.axes
    assert heights(first) == {
        "best control": [0.0, 0.0],
        "care": [5.0, -5.0],
        "seed-finder §": [20.0, 10.0],
    }
    assert heights(overall)["care"] == [-30.0, -10.0]
    named = "Best control: in first-sighting recall place at 10% and rows at 20%; in overall"
    assert named in " ".join(figure.get_supxlabel().split())
    zorders = {line.get_label(): line.zorder for line in overall.lines}
    assert zorders.pop("care") > max(zorders.values())


def test_without_a_control_or_a_measure_there_is_no_figure():
    untagged = [row | {"tags": None} for row in PLAYS]
    assert "controls-streets" not in protocol_figures(untagged)
    quiet = [
        row | dict.fromkeys(("events", "sighted", "delay"), 0.0) | {"ttfds": ()} for row in PLAYS
    ]
    (panel,) = protocol_figures(quiet)["controls-streets"].axes
    assert panel.get_title(loc="left") == "overall recall"


def test_orders_of_the_open_loop_have_a_panel_a_budget():
    plays = study({"full": (15, 9)})
    assert open_order_figures(plays) == {}
    for number, order in enumerate(ORDERS):
        each = {"history": (4, 6), "care": (6 + number, 5)}
        plays += study(each, budgets=(0.03, 0.1), seeds=(0,), cell_order=order)
    figure = open_order_figures(plays)["order-open-loop"]
    assert titles(figure) == ["budget 3%", "budget 10%"]
    shown = heights(figure.axes[1])
    assert shown["care"] == [30.0, 35.0, 40.0, 45.0, 50.0, 55.0]
    assert {*shown["full scan"]} == {75.0}
