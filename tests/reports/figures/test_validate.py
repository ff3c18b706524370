"""The figure of a validation."""

import pytest

from care_sim.reports.figures.validate import validation_figures
from tests.helpers.made_worlds import MIRRORED, STUDY, TELLING, TRAINING, cell, world


def heights(axes):
    return {line.get_label(): list(line.get_ydata()) for line in axes.lines}


def test_every_world_has_its_place_with_the_factor_that_is_changed():
    figure = validation_figures(STUDY)["validation"]
    found, hit = figure.axes
    assert [label.get_text() for label in hit.get_xticklabels()] == ["dartout", "mirrored drawn"]
    assert found.get_title(loc="left") == "budget 3%"
    assert figure.get_suptitle() == "dartout, then with one factor changed: 6 test seeds"
    assert heights(found)["care"] == [16.0, 15.0]
    assert heights(found)["best control"] == [16.0, 10.0]
    assert heights(hit)["history"] == [0.0, 100.0]
    assert heights(hit)["all-camera"] == [0.0, pytest.approx(50.0)]
    assert "seed-finder §" in heights(found)


def test_alone_a_world_has_no_factor_and_what_stands_at_zero_is_in_sight():
    figure = validation_figures(world(TELLING, TRAINING))["validation"]
    assert figure.get_suptitle() == "dartout: 6 test seeds"
    assert "best control of dartout: " in figure.get_supxlabel()
    assert all(axes.get_ylim()[0] < 0 for axes in figure.axes)
    assert [axes.get_xticklabels() for axes in figure.axes] == [[], []]


def test_the_best_control_is_that_of_each_world():
    fan_is_best = TRAINING | {"rows": (9.0, 3), "fan": (14.0, 0)}
    rows = [*world(TELLING, TRAINING), *world(TELLING, fan_is_best, parameters=MIRRORED)]
    figure = validation_figures(rows)["validation"]
    assert heights(figure.axes[0])["best control"] == [10.0, 15.0]


def test_somebody_never_detected_stands_at_zero():
    rows = [*cell("care", [None] * 3), *cell("full", [9.0] * 3)]
    figure = validation_figures(rows)["validation"]
    assert heights(figure.axes[0])["care"] == [0.0]
    assert heights(figure.axes[0])["full scan"] == [9.0, 9.0]
