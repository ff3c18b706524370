"""Names of curves at their right ends, none of which lies over another."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Annotation

from care_sim.reports.figures.files import texts_as_they_are

_NAME_POINTS = 8
_LINE_SPACING = 1.15
_INCH_POINTS = 72


def name_ends(figure: Figure, ends: Mapping[Axes, Mapping[str, tuple[float, str]]]) -> None:
    """Name curves right of their axes, each at the height of its right end and in its colour; names
    that would overlap move up or down. The figure keeps the layout that it has then.
    """
    names = {axes: [*map(partial(_name, axes), own, own.values())] for axes, own in ends.items()}
    # Heights on paper are known once the names have taken their room.
    with texts_as_they_are(figure):
        figure.draw_without_rendering()
    figure.set_layout_engine("none")
    points = _INCH_POINTS / figure.dpi
    for axes, own in names.items():
        heights = {name: axes.transData.transform(name.xy)[1] * points for name in own}
        upwards = sorted(own, key=lambda name: heights[name])
        box = axes.get_window_extent()
        least = _LINE_SPACING * _NAME_POINTS
        moved = apart([heights[name] for name in upwards], least, box.y0 * points, box.y1 * points)
        for name, place in zip(upwards, moved, strict=True):
            name.set_position((4, place - heights[name]))


def _name(axes: Axes, name: str, end: tuple[float, str]) -> Annotation:
    height, colour = end
    look: dict[str, Any] = {"va": "center", "size": _NAME_POINTS, "color": colour}
    look |= {"xycoords": axes.get_yaxis_transform(), "textcoords": "offset points"}
    return axes.annotate(name, (1.0, height), (4, 0), annotation_clip=False, **look)


def apart(heights: Sequence[float], least: float, low: float, high: float) -> list[float]:
    """Ascending heights, moved as little as can be so that each is at least `least` above the one
    before and all are between `low` and `high`, where there is room.
    """
    from scipy.optimize import isotonic_regression

    steps = least * np.arange(len(heights))
    moved = isotonic_regression(np.array(heights) - steps).x + steps
    moved = np.maximum(moved, low + steps)
    # The highest stays below the top, and those below it have room for the ones above.
    return [float(place) for place in np.minimum(moved, high - steps[::-1])]
