"""The figure of the study of hardware, on rows made by hand."""

from care_sim.reports.figures.firing import firing_figures
from care_sim.study.designs.firing import FIRINGS, firing_study
from tests.helpers.made_rows import row


def distance(config):
    """Tiles cost a metre on the default grid; rows never detect anybody with the mirror."""
    if config.policy == "full":
        return 16.0
    if config.sensor == "m1-forward":
        return None if config.firing == "rows" else 12.0 + config.budget * 10
    return 14.0 if config.firing == "tiles:4x8" else 15.0


def heights(axes):
    return {line.get_label(): [round(y, 3) for y in line.get_ydata()] for line in axes.lines}


def test_a_panel_a_set_up_shows_every_unit_that_divides_its_grid():
    configs = firing_study([0], sensors=["hdl-32e", "m1-forward"])
    figure = firing_figures([row(config, distance(config)) for config in configs])["firing"]
    usual, mirror = figure.axes
    assert usual.get_title(loc="left") == "hdl-32e"
    assert mirror.get_title(loc="left").startswith("m1-forward ")
    shown = heights(usual)
    assert {*shown} == {*FIRINGS, "full scan"}
    assert shown["tiles:4x8"] == [14.0] * 3
    assert set(shown["full scan"]) == {16.0}
    shown = heights(mirror)
    fitting = {"cells", "rows", "columns", "vertical-window", "energy:4"}
    assert {*shown} == fitting | {"full scan"}
    assert shown["cells"] == [12.3, 12.5, 13.0]
    # Where a median is not detected the curve stands at the bottom, as the head says.
    assert shown["rows"] == [0.0] * 3
    assert "at 0: not detected" in figure.get_suptitle()
    assert [label.get_text() for label in mirror.get_xticklabels()] == ["3%", "5%", "10%"]


def test_without_several_budgets_there_is_none():
    configs = [config for config in firing_study([0]) if config.budget in (0.1, 1.0)]
    assert firing_figures([row(config, 9.0) for config in configs]) == {}
