"""Figures of the study of the order of cells."""

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from care_sim.reports.figures.files import save
from care_sim.reports.figures.order import open_order_figures, order_figures
from care_sim.study.designs.order import ORDERS, order_study
from tests.helpers import made_plays
from tests.helpers.made_rows import row


def distance(config):
    """History never detects anybody on the dense street; the reserves grow by order."""
    if config.policy == "history":
        return None if config.scenario == "dense" else 8.0
    return 16.0 if config.policy == "full" else 10.0 + ORDERS.index(config.cell_order)


EPISODES = [row(config, distance(config)) for config in order_study([0])]
PLAYS = [
    play
    for number, order in enumerate(ORDERS)
    for play in made_plays.study(
        {"history": (4, 6), "care": (6 + number, 5)},
        budgets=(0.03, 0.1),
        seeds=(0,),
        cell_order=order,
    )
] + made_plays.study({"full": (15, 9)})


def heights(axes):
    return {line.get_label(): list(line.get_ydata()) for line in axes.lines}


def test_a_panel_a_place_shows_every_policy_under_every_order():
    figure = order_figures(EPISODES)["order"]
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert titles == ["dartout, 3%", "dartout, 10%", "dense, 3%", "dense, 5%"]
    shown = heights(figure.axes[0])
    assert shown["care"] == [10.0, 11.0, 12.0, 13.0, 14.0, 15.0]
    assert shown["history"] == [8.0] * 6
    assert set(shown["full scan"]) == {16.0}
    assert [label.get_text() for label in figure.axes[0].get_xticklabels()] == list(ORDERS)


def test_a_median_that_is_not_detected_stands_at_zero():
    figure = order_figures(EPISODES)["order"]
    assert heights(figure.axes[2])["history"] == [0.0] * 6
    assert "not detected" in figure.get_suptitle()


def test_a_panel_a_budget_shows_first_sightings():
    figure = open_order_figures(PLAYS)["order-open-loop"]
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["budget 3%", "budget 10%"]
    shown = heights(figure.axes[1])
    assert shown["care"] == [30.0, 35.0, 40.0, 45.0, 50.0, 55.0]
    assert shown["history"] == [20.0] * 6
    assert set(shown["full scan"]) == {75.0}


def test_markers_of_one_order_stand_apart_and_nearer_to_it_than_to_the_next():
    axes = order_figures(EPISODES)["order"].axes[0]
    places = [line.get_xdata() for line in axes.lines if line.get_label() != "full scan"]
    assert len({own[0] for own in places}) == len(places) == 4
    assert all(abs(x - n) < 0.5 for own in places for n, x in enumerate(own))


@pytest.mark.parametrize(("draw", "rows"), [(order_figures, EPISODES), (open_order_figures, PLAYS)])
def test_figures_are_written_the_same_every_time(draw, rows, tmp_path):
    ((name, figure),) = draw(rows).items()
    save(figure, tmp_path / name)
    first = (tmp_path / f"{name}.svg").read_bytes()
    save(draw(rows)[name], tmp_path / name)
    assert (tmp_path / f"{name}.svg").read_bytes() == first


@pytest.mark.parametrize("budgets", [(0.03,), (0.03, 0.1)])
def test_the_title_fits_into_the_figure(budgets):
    wide = made_plays.study({"care-sightlines": (7, 5)}, budgets=budgets, cell_order="rows-down")
    plays = [*PLAYS, *wide]
    (figure,) = open_order_figures([p for p in plays if p["budget"] in (*budgets, 1.0)]).values()
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    title = figure.findobj(lambda artist: getattr(artist, "get_text", str)().startswith("order of"))
    box = title[0].get_window_extent(canvas.get_renderer())
    legend = figure.legends[0].get_window_extent(canvas.get_renderer())
    assert 0 <= box.x0 < box.x1 <= legend.x0
    assert " ".join(title[0].get_text().split()) == (
        "order of the cells inside a set: generated streets, detector returns, 6 scenes"
    )


def test_the_full_scan_alone_draws_nothing():
    assert open_order_figures(made_plays.study({"full": (15, 9)})) == {}


def test_places_that_were_not_played_have_no_panel():
    dense = [row for row in EPISODES if row["scenario"] == "dense"]
    figure = order_figures(dense)["order"]
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["dense, 3%", "dense, 5%"]
    assert order_figures([row for row in EPISODES if row["scenario"] == "cutin"]) == {}
