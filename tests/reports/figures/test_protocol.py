"""Figures 2 and 3 of the paper from plays."""

from fnmatch import fnmatch

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb

from care_sim.reports.figures.apart import BESIDE_PLACES
from care_sim.reports.figures.files import save
from care_sim.reports.figures.protocol import frontier, protocol_figures
from care_sim.reports.figures.styles import styles
from care_sim.reports.studies import STUDIES
from tests.helpers.made_plays import study

FOUND = {
    "history": (4, 6),
    "care": (6, 5),
    "beam-reduce": (5, 2),
    "history-oracle": (7, 7),
    "full": (8, 8),
}
ROWS = study(FOUND)
BUDGETS = (0.01, 0.02, 0.03, 0.05, 0.1, 0.2, 0.35)


def test_every_setting_has_its_figures_and_their_names_are_known():
    rows = [
        *ROWS,
        *study(FOUND, camera_latency=1, budgets=(0.1,)),
        *study({"full": (8, 8)}, source="nuscenes"),
    ]
    figures = protocol_figures(rows)
    assert list(figures) == ["pareto-streets", "levels-streets", "pareto-streets-camera-latency-1"]
    patterns = STUDIES["protocol"].figures_of()
    assert all(any(fnmatch(name, pattern) for pattern in patterns) for name in figures)
    assert not any(fnmatch("pareto-mine", pattern) for pattern in patterns)
    own = STUDIES["protocol"].figures_of([row | {"source": "mine:Film"} for row in rows])
    assert any(fnmatch("pareto-mine-Film", pattern) for pattern in own)


@pytest.mark.parametrize("name", ["pareto-streets", "levels-streets"])
def test_figures_are_written_the_same_every_time(name, tmp_path):
    save(protocol_figures(ROWS)[name], tmp_path / name)
    first = (tmp_path / f"{name}.svg").read_bytes()
    save(protocol_figures(ROWS)[name], tmp_path / name)
    assert (tmp_path / f"{name}.svg").read_bytes() == first
    assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_a_panel_a_budget_and_a_staircase_over_what_a_car_can_have():
    figure = protocol_figures(ROWS)["pareto-streets"]
    assert [axes.get_title(loc="left") for axes in figure.axes] == [
        "budget 10%",
        "budget 20%",
        "budget 35%",
    ]
    axes = figure.axes[0]
    markers = {line.get_label(): (*line.get_xdata(), *line.get_ydata()) for line in axes.lines[:-1]}
    assert markers == {
        "history": (60.0, 20.0),
        "care": (50.0, 30.0),
        "beam-reduce": (20.0, 25.0),
        "history-oracle †": (70.0, 35.0),
    }
    stairs = axes.lines[-1]
    assert stairs.get_drawstyle() == "steps-pre"
    left, low = axes.get_xlim()[0], axes.get_ylim()[0]
    assert np.array_equal(
        stairs.get_xydata(), [(left, 30.0), (50.0, 30.0), (60.0, 20.0), (60.0, low)]
    )
    assert "full scan: 40.0% of first sightings, 80.0% overall" in figure.get_supxlabel()


def test_many_budgets_take_several_lines_of_panels():
    figure = protocol_figures(study(FOUND, budgets=BUDGETS))["pareto-streets"]
    drawn = [axes for axes in figure.axes if axes.axison]
    assert len(drawn) == len(BUDGETS)
    assert {axes.get_subplotspec().get_geometry()[:2] for axes in drawn} == {(2, 4)}


def test_a_thin_marker_is_seen():
    figure = protocol_figures(study(FOUND | {"rows": (5, 5)}))["levels-streets"]
    edges = {line.get_label(): to_rgb(line.get_markeredgecolor()) for line in figure.axes[0].lines}
    assert edges["rows"] == to_rgb(styles([("rows", ("control",))])["rows"].colour)
    assert edges["care"] == (1.0, 1.0, 1.0)


def test_levels_have_a_line_a_policy_and_the_full_scan():
    first, overall = protocol_figures(ROWS)["levels-streets"].axes
    (legend,) = protocol_figures(ROWS)["levels-streets"].legends
    names = [text.get_text() for text in legend.get_texts()]
    measured = ["full scan", "history", "care", "beam-reduce", "history-oracle †"]
    assert names == [*measured, "paper: full scan", "paper: history", "paper: care"]
    care = next(line for line in first.lines if line.get_label() == "care")
    assert list(care.get_ydata()) == [30.0] * 3
    assert list(overall.lines[0].get_ydata()) == [80.0, 80.0]
    said = {
        line.get_label(): list(line.get_ydata())
        for line in overall.lines
        if "paper" in line.get_label()
    }
    assert said["paper: full scan"] == [49.4, 49.4]
    assert said["paper: care"] == [pytest.approx(0.94 * 49.4)]
    strict = [row | {"camera_latency": 1} for row in ROWS]
    (panel, _) = protocol_figures(strict)["levels-streets-camera-latency-1"].axes
    assert not [line for line in panel.lines if "paper" in line.get_label()]


def test_the_levels_say_that_policies_are_moved_apart():
    figure, alone = (
        protocol_figures(study(found))["levels-streets"] for found in (FOUND, {"care": (6, 5)})
    )
    first, second = (line.get_xdata() for line in figure.axes[0].lines[1:3])
    assert second[0] - first[0] == pytest.approx(0.025 * 0.1)
    said = "policies are drawn a little apart sideways, so that equal points stay visible"
    assert said in figure.get_supxlabel().splitlines()
    assert said not in alone.get_supxlabel()


PILE = [*FOUND, "all-camera", "care-sbf", "care-spread", "place", "rows", "uncertainty"]


def a_pile():
    """A figure with all policies at one place, its panel, and their markers."""
    figures = protocol_figures(study(dict.fromkeys(PILE, (5, 5)), budgets=(0.1,)))
    figure = figures["pareto-streets"]
    (axes,) = figure.axes
    return figure, axes, [line for line in axes.lines if line.get_marker() != "None"]


@pytest.mark.parametrize("dpi", [72, 200])
def test_a_line_leads_from_every_marker_that_was_moved_to_a_dot_at_its_place(dpi):
    figure, axes, markers = a_pile()
    figure.set_dpi(dpi)
    figure.draw_without_rendering()
    points = 72 / dpi

    def on_paper(transform, at):
        return transform.transform(at) * points

    middles = np.array([on_paper(m.get_transform(), m.get_xydata()[0]) for m in markers])
    apart = np.hypot(*(middles[:, None] - middles[None]).transpose(2, 0, 1))
    assert apart[~np.eye(len(markers), dtype=bool)].min() > 5.9
    place = on_paper(axes.transData, (50.0, 25.0))
    moved = [middle - place for middle in middles if not np.allclose(middle, place)]
    assert len(moved) >= len(markers) - 1
    assert [tuple(text.xy) for text in axes.texts] == [(50.0, 25.0)] * len(moved)
    assert np.allclose([text.xyann for text in axes.texts], moved)
    (dots,) = axes.collections
    assert np.allclose(dots.get_offsets(), (50.0, 25.0))


def test_markers_at_one_place_are_all_seen():
    figure, axes, markers = a_pile()
    assert len(markers) == len(PILE) - 1
    assert {(*line.get_xdata(), *line.get_ydata()) for line in markers} == {(50.0, 25.0)}
    assert BESIDE_PLACES in figure.get_supxlabel().splitlines()
    alone = protocol_figures(study({"care": (6, 5)}))["pareto-streets"]
    assert BESIDE_PLACES not in alone.get_supxlabel()
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    for line in (*axes.lines, *axes.texts, *axes.collections):
        line.set_visible(False)
    canvas.draw()
    ground = canvas.copy_from_bbox(figure.bbox)

    def picture(shown):
        canvas.restore_region(ground)
        for marker in sorted(shown, key=lambda marker: marker.zorder):
            marker.set_visible(True)
            axes.draw_artist(marker)
        return np.array(canvas.buffer_rgba(), dtype=int)

    for marker in markers:
        alone = np.any(picture([marker]) != picture([]), axis=-1).sum()
        others = [other for other in markers if other is not marker]
        seen = np.any(picture(markers) != picture(others), axis=-1).sum()
        assert seen > 0.3 * alone > 0, marker.get_label()


POINTS = st.dictionaries(
    st.text("abcdefgh", min_size=1), st.tuples(*[st.integers(0, 9)] * 2), min_size=1
)


@given(POINTS)
def test_the_frontier_falls_as_it_goes_right_and_nothing_lies_beyond_it(points):
    best = [points[name] for name in frontier(points)]
    corners = sorted(set(best))
    assert sorted((y for _, y in corners), reverse=True) == [y for _, y in corners]
    assert len({x for x, _ in corners}) == len({y for _, y in corners}) == len(corners)
    assert all(any(x <= a and y <= b for a, b in best) for x, y in points.values())
