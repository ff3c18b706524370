"""All figures of curves share which curves have names, and where names and marks are."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.colors import to_hex

from care_sim.reports.figures.curves import (
    FULL_SCAN,
    MOST_NAMED,
    Panel,
    Point,
    curves_figure,
    point,
)
from care_sim.reports.figures.styles import CALM, INK, apart, colours
from tests.helpers.drawn import heights

NAN = float("nan")
CONTROL = ("control",)
PLAYED = {
    "first": [9.0, 9.0],
    "history": [1.0, 2.0],
    "weak": [1.0, 1.0],
    "care": [3.0, 4.0],
    "all-camera": [2.0, NAN],
    "fan": [0.0, 0.5],
    "rows": [0.0, 0.2],
    "second": [8.0, 8.0],
    "third": [7.0, 7.0],
    "oracle": [10.0, 10.0],
    "absent": [None, None],
    "full": [11.0, 11.0],
}
TAGS = {"fan": CONTROL, "rows": CONTROL, "oracle": ("privileged",)}


def panel(played, **more):
    """A panel of two budgets, or of one."""
    ticks = dict(zip(("10%", "20%"), (0, 1), strict=True))
    return Panel.of(
        "",
        played,
        {name: at for name, at in ticks.items() if at < len(next(iter(played.values())))},
        lambda name, at: point(played[name][at]),
        **more,
    )


def drawn(*panels, tags=TAGS, **more):
    return curves_figure("name", "title", panels, tags, **more)["name"]


PANEL = panel(PLAYED, places=(0.1, 0.2))


def test_seven_are_named_by_the_rule_and_all_others_are_grey():
    named = ["care", "history", "all-camera", FULL_SCAN, "fan", "first", "second"]
    assert PANEL.named(TAGS) == named
    figure = drawn(PANEL)
    (axes,) = figure.axes
    assert {text.get_text() for text in axes.texts} == {*named}
    assert len(axes.texts) == MOST_NAMED
    hues = {line.get_label(): to_hex(line.get_color()) for line in axes.lines}
    assert hues["care"] == colours(["care"])["care"].lower()
    assert {hues[name] for name in ("weak", "rows", "third", "oracle †")} == {CALM}
    assert "absent" not in hues
    assert "grey: all others" in " ".join(figure.get_supxlabel().split())


def test_what_no_car_can_have_is_named_last_and_marked():
    few = panel({"oracle": [9.0], "care": [1.0]})
    assert few.named(TAGS) == ["care", "oracle"]
    figure = drawn(few)
    assert [text.get_text() for text in figure.axes[0].texts] == ["oracle †", "care"]
    assert "† knows the truth" in figure.get_supxlabel()
    assert not {"grey", "hollow"} & {*figure.get_supxlabel().split()}


def test_where_less_is_better_the_least_are_named():
    many = panel({str(n): [float(n)] for n in range(9)}, less_is_better=True)
    assert many.named({}) == [str(n) for n in range(MOST_NAMED)]


def test_every_mark_is_at_its_value_and_what_is_not_detected_is_hollow_at_0():
    figure = drawn(PANEL)
    (axes,) = figure.axes
    assert heights(axes)["care"] == [3.0, 4.0]
    assert heights(axes)["all-camera"] == [2.0, 0.0]
    (hollow,) = (line for line in axes.lines if line.get_markerfacecolor() == "none")
    assert (list(hollow.get_xdata()), list(hollow.get_ydata())) == ([0.2], [0.0])
    assert hollow.get_color() == colours(["all-camera"])["all-camera"]
    assert "hollow, at 0: not detected" in figure.get_supxlabel()


def test_bars_are_of_the_first_curve_alone():
    own = {"history": Point(1.0, (0.0, 3.0)), "care": Point(3.0, (2.0, 5.0))}
    both = Panel.of("", own, {"a": 0}, lambda name, _: own[name])
    (bar,) = drawn(both, bars="quartiles").axes[0].collections
    assert [end.tolist() for end in bar.get_segments()[0]] == [[0.0, 2.0], [0.0, 5.0]]
    assert "bars: quartiles of care" in drawn(both, bars="quartiles").get_supxlabel()
    assert not drawn(both).axes[0].collections


@pytest.mark.parametrize("panels", [1, 2, 4])
def test_no_two_names_overlap_and_none_is_cut_off(panels):
    alike = panel({f"policy-{n}": [1.0, 1.0] for n in range(9)})
    figure = drawn(*[alike] * panels)
    figure.set_dpi(200)
    figure.draw_without_rendering()
    for axes in figure.axes:
        boxes = sorted((text.get_window_extent() for text in axes.texts), key=lambda box: box.y0)
        assert all(below.y1 <= above.y0 + 2 for below, above in pairwise(boxes))
        assert all(box.x1 <= figure.bbox.x1 for box in boxes)
        assert all(box.y0 >= 0 and box.y1 <= figure.bbox.y1 for box in boxes)


@given(st.lists(st.floats(0, 10), min_size=1, max_size=7).map(sorted))
def test_names_are_moved_apart_between_the_ends_of_the_axis(ends):
    moved = apart(ends, 1.0, 0.0, 10.0)
    assert np.diff(moved, prepend=-1.0).min() > 1.0 - 1e-9
    assert 0.0 <= moved[0] <= moved[-1] <= 10.0
    # Others move as little as can be.
    assert apart([0.0, 5.0], 1.0, 0.0, 6.0) == [0.0, 5.0]


def test_every_colour_is_read_on_white_and_on_the_dark_page():
    def luminance(colour):
        parts = [int(colour[n : n + 2], 16) / 255 for n in (1, 3, 5)]
        linear = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
        return float(np.dot((0.2126, 0.7152, 0.0722), linear)) + 0.05

    for colour in (INK, *colours([*PLAYED, "care-sbf", "ppo", "learned-sets", "place"]).values()):
        assert 1.05 / luminance(colour) > 3
        assert luminance(colour) / luminance("#14181c") > 3
