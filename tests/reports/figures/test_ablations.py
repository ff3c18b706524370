"""Figures of the ablations."""

import pytest
from matplotlib.colors import to_hex

from care_sim.reports.figures.ablations import ablation_figures, open_ablation_figures
from care_sim.study.designs.ablations import ablation_study
from care_sim.study.designs.variants import Variant
from tests.helpers import made_plays
from tests.helpers.made_rows import row


def distance(config):
    """A small reserve costs 2 m on the dense street; a late camera up to 1.5 m, by the seed."""
    if config.policy == "care" and config.scenario == "dense" and config.reserve_fraction == 0.15:
        return 14.0
    if config.policy == "care" and config.camera_latency == 1:
        return 16.0 - 0.5 * (config.seed % 4)
    return 16.0


EPISODES = [row(config, distance(config)) for config in ablation_study(range(5))]


def drawn(axes):
    """Mean, colour and filling of every level, by what is varied and its label."""
    varied, shown = "", {}
    labels = [label.get_text() for label in axes.figure.axes[0].get_yticklabels()]
    points = {
        line.get_ydata()[0]: (
            float(line.get_xdata()[0]),
            to_hex(line.get_color()),
            line.get_markerfacecolor() != "white",
        )
        for line in axes.lines
        if line.get_marker() == "o"
    }
    for height, label in enumerate(labels):
        varied = label.partition(": ")[2] if label.startswith("care") else varied
        if height in points:
            shown[varied, label] = points[height]
    return shown


def test_a_level_stands_by_its_difference_to_the_usual_one():
    (figure,) = ablation_figures(EPISODES).values()
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert titles == ["dartout, 3%", "dartout, 10%", "dense, 2%", "dense, 3%"]
    dartout, _, dense, _ = map(drawn, figure.axes)
    grey, blue = to_hex("0.6"), "#0072b2"
    assert dense["reserve fraction rho", "0.15"] == (-2.0, blue, True)
    assert dartout["reserve fraction rho", "0.15"] == (0.0, grey, True)
    names = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    late = names.index("care: age of the camera's detections, keyframes") + 1
    (interval,) = (
        line.get_xdata()
        for line in figure.axes[0].lines
        if line.get_marker() != "o" and list(line.get_ydata()) == [late, late]
    )
    assert -1.5 < interval[0] < -0.6 < interval[1] < 0.0
    assert "0.3" not in names, "the usual level is compared with nothing"
    assert "5 seeds" in figure.get_supxlabel()


def test_a_bound_is_drawn_open():
    """A level that never detects has no distance, only one that it was not above."""
    never = [
        row(one, None if one.reserve_fraction == 0.15 else 16.0) for one in ablation_study(range(5))
    ]
    (figure,) = ablation_figures(never).values()
    shown = drawn(figure.axes[0])
    assert not shown["reserve fraction rho", "0.15"][2]
    assert shown["reserve fraction rho", "0.5"][2]
    assert "open: a bound" in figure.get_supxlabel()


def test_what_was_not_played_has_no_line_and_nothing_no_figure():
    few = [
        one
        for one in EPISODES
        if one["camera_latency"] == 0 and one["camera_confidence"] == pytest.approx(0.25)
    ]
    (figure,) = ablation_figures(few).values()
    names = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert "care: reserve fraction rho" in names
    assert "care: age of the camera's detections, keyframes" not in names
    usual = [one for one in few if one["policy"] == "history"]
    assert ablation_figures(usual) == {}


def test_a_panel_a_budget_and_measure_shows_points_of_recall():
    late = Variant("1", {"camera_latency": 1})
    plays = made_plays.study({"care": (8, 6)}, seeds=(0,), budgets=(0.1,)) + made_plays.study(
        {"care": (5, 6)}, seeds=(0,), budgets=(0.1,), **late.changes
    )
    (figure,) = open_ablation_figures(plays).values()
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert titles == ["first sightings, 10%", "all below 20 m, 10%"]
    level = "age of the camera's detections, keyframes", "1"
    assert drawn(figure.axes[0])[level][0] == pytest.approx(-15.0)
    assert drawn(figure.axes[1])[level][0] == pytest.approx(0.0)
