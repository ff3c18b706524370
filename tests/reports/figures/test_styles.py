"""What every figure shares: a legend that fits."""

from matplotlib.figure import Figure

from care_sim.reports.figures.styles import name_outside


def drawn(names):
    figure = Figure(figsize=(8.0, 3.0), layout="constrained")
    panels = figure.subplots(1, 2)
    for axes, own in zip(panels, names, strict=True):
        for name in own:
            axes.plot([0, 1], [0, 1], label=name)
    name_outside(figure, panels)
    return figure


def test_a_legend_names_what_any_panel_shows_once():
    figure = drawn([["care", "rows"], ["care", "place"]])
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["care", "rows", "place"]
    assert figure.get_figheight() == 3.0


def test_a_figure_grows_until_its_legend_is_whole():
    figure = drawn([[f"policy {number}" for number in range(30)], []])
    figure.draw_without_rendering()
    (legend,) = figure.legends
    assert legend.get_window_extent().y0 >= 0
