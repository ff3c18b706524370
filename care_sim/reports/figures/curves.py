"""Figures of curves: at most seven of a panel in colour, each named at its right end, the rest thin
and grey.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from textwrap import fill, wrap
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Annotation

from care_sim.base.errors import percent
from care_sim.reports.engine.controls import is_control
from care_sim.reports.figures.files import texts_as_they_are
from care_sim.reports.figures.styles import CALM, INK, colours
from care_sim.reports.formatting import MARKS, marked, tag_notes
from care_sim.study.run_config import REFERENCE

FULL_SCAN = "full scan"
MOST_NAMED = 7
"""Curves and lines of a panel that have a name and a colour."""
_FIRST = (REFERENCE, "history", "all-camera", FULL_SCAN)
_HOLLOW = "hollow, at 0: not detected"
_PAPER = "diamonds, dotted line: what the paper reports"
_NAME_POINTS = 8
_LINE_SPACING = 1.15
_INCH_POINTS = 72
_SIZES = {1: (6.5, 3.6), 2: (4.6, 3.3)}
_NARROW = (3.4, 2.4)
"""Width and height in inches of a panel with its names, by the number of panels, and of more."""
_NOTE_INCHES = 0.17
_INCH_LETTERS = 12
"""Letters of a note on an inch."""
_TURNED = 6
"""Letters of a tick above which ticks are turned."""

Tags = Mapping[str, tuple[str, ...]]
Heights = Sequence[float | None]


@dataclass(frozen=True)
class Panel:
    """The curves of one panel over its ticks.

    `heights` of every curve: None where it was not played, nan where it has no median. `places` of
    the ticks on a logarithmic axis; without them the ticks are side by side. `lines` go across
    the panel by name. `ends` are the two ends of an interval at every tick. `paper` holds
    what the paper reports of a curve, tick by tick, and of the full scan at the first tick.
    """

    title: str
    ticks: Sequence[str]
    heights: Mapping[str, Heights]
    label: str = ""
    places: Sequence[float] = ()
    lines: Mapping[str, float] = field(default_factory=dict)
    ends: Mapping[str, Sequence[tuple[float, float] | None]] = field(default_factory=dict)
    paper: Mapping[str, Heights] = field(default_factory=dict)
    unit: str = ""
    less_is_better: bool = False

    @classmethod
    def by_budget(cls, title: str, budgets: Sequence[float], **rest: Any) -> "Panel":
        """A panel with a tick at every budget."""
        return cls(title, [*map(percent, budgets)], places=budgets, **rest)

    def named(self, tags: Tags) -> list[str]:
        """The curves with a name: the paper's policies, the best control, then the best others by
        their mean; those that no car can have come last.
        """
        means = {
            name: np.mean([0.0 if math.isnan(height) else height for height in played])
            for name, heights in self.heights.items()
            if (played := [height for height in heights if height is not None])
        }
        ranked = sorted(means, key=lambda name: means[name], reverse=not self.less_is_better)
        ranked.sort(key=lambda name: bool({*tags.get(name, ())} & {*MARKS}))
        control = next((name for name in ranked if is_control(tags.get(name, ()))), REFERENCE)
        first = [name for name in (*_FIRST, control) if name in means]
        return [*dict.fromkeys([*first, *ranked])][: MOST_NAMED - len(self.lines)]


def curves_figure(
    title: str,
    panels: Sequence[Panel],
    tags: Tags,
    notes: Sequence[str] = (),
    columns: int = 3,
    share: bool | Literal["row"] = False,
    from_zero: bool = True,
    bars: str = "",
) -> Figure:
    """All panels, `columns` of them side by side; `share` whether they have one scale. `tags` of
    the policies among the curves, `notes` below the panels. `bars` says what `ends` are.
    """
    columns = min(columns, len(panels))
    lines = math.ceil(len(panels) / columns)
    width, height = _SIZES.get(len(panels), _NARROW)
    width *= columns
    leaders = dict.fromkeys(name for panel in panels for name in _with_bars(panel, tags))
    drawn = [f"bars: {bars} of {' and '.join(leaders)}"] if leaders else []
    said = [*notes, *drawn, *_on_marks(panels, tags)]
    below = [line for note in said for line in wrap(note, int(_INCH_LETTERS * width))]
    size = (width, height * lines + 0.4 + _NOTE_INCHES * len(below))
    figure = Figure(figsize=size, layout="constrained")
    # Ticks below each other are named once.
    alike = len({tuple(panel.ticks) for panel in panels}) == 1 and len(panels) == lines * columns
    across = figure.subplots(lines, columns, squeeze=False, sharex=alike, sharey=share)
    grid = across.ravel().tolist()
    hues = colours(dict.fromkeys(name for panel in panels for name in panel.heights))
    named = [_draw(axes, panel, tags, hues) for axes, panel in zip(grid, panels, strict=False)]
    for axes in grid[len(panels) :]:
        axes.set_axis_off()
    for axes in grid[: len(panels)] if from_zero else ():
        axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    figure.suptitle(fill(title, int(_INCH_LETTERS * width)), x=0.01, ha="left")
    figure.supxlabel("\n".join(below), fontsize=9)
    name_ends(figure, dict(zip(grid, named, strict=False)))
    return figure


def _on_marks(panels: Sequence[Panel], tags: Tags) -> list[str]:
    """What the marks of these panels mean."""
    curves = [(name, panel.heights[name]) for panel in panels for name in panel.named(tags)]
    heights = [height for _, own in curves for height in own if height is not None]
    known = {name for panel in panels for name in (*panel.heights, *panel.lines)}
    control = ["the best control"] if any(is_control(own) for own in tags.values()) else []
    always = ", ".join([*(name for name in _FIRST if name in known), *control])
    rule = f"named: {always}, and the best by their mean over the panel; grey: all others"
    return [
        *([rule] if any(len(each.heights) > len(each.named(tags)) for each in panels) else []),
        *([_HOLLOW] if any(map(math.isnan, heights)) else []),
        *([_PAPER] if any(panel.paper for panel in panels) else []),
        *tag_notes(tags.get(name, ()) for name, _ in curves),
    ]


def _draw(
    axes: Axes, panel: Panel, tags: Tags, hues: Mapping[str, str]
) -> dict[str, tuple[float, str]]:
    """Draw a panel; the right ends of its named curves, each with its colour."""
    named = panel.named(tags)
    ends = {name: (height, INK) for name, height in panel.lines.items()}
    for name, height in panel.lines.items():
        axes.axhline(height, color=INK, linestyle="--", linewidth=1.2, label=name, zorder=1)
    places = [*(panel.places or range(len(panel.ticks)))]
    for name, heights in panel.heights.items():
        played = [(x, y) for x, y in zip(places, heights, strict=True) if y is not None]
        label = marked(name, tags.get(name, ()))
        if name in named:
            ends[label] = _curve(axes, played, hues[name], label), hues[name]
        elif played:
            _curve(axes, played, CALM, label, named=False)
    for name in _with_bars(panel, tags):
        for place, pair in zip(places, panel.ends[name], strict=True):
            if pair is not None:
                axes.vlines(place, *pair, color=hues[name], linewidth=1.2, zorder=2)
    _draw_paper(axes, panel, places, {FULL_SCAN: INK} | {name: hues[name] for name in named})
    _set_axes(axes, panel, places)
    return ends


def _set_axes(axes: Axes, panel: Panel, places: Sequence[float]) -> None:
    if panel.places:
        axes.set_xscale("log")
    axes.set_xticks(places, panel.ticks)
    axes.minorticks_off()
    if max(map(len, panel.ticks)) > _TURNED:
        for tick in axes.get_xticklabels():
            tick.set(rotation=35, ha="right", rotation_mode="anchor")
    axes.set(ylabel=panel.label, xlabel=panel.unit)
    axes.set_title(panel.title, loc="left")


def _curve(
    axes: Axes, points: Sequence[tuple[float, float]], colour: str, label: str, named: bool = True
) -> float:
    """Draw a curve; the height of its right end."""
    places, heights = zip(*points, strict=True)
    drawn = [0.0 if math.isnan(height) else height for height in heights]
    missed = [number for number, height in enumerate(heights) if math.isnan(height)]
    look: dict[str, Any] = {"color": colour, "label": label, "linewidth": 0.7, "alpha": 0.6}
    if named:
        found = [number for number in range(len(heights)) if number not in missed]
        look |= {"linewidth": 1.6, "alpha": 1.0, "marker": "o", "markersize": 4}
        look |= {"markevery": found, "zorder": 4 if label == REFERENCE else 3}
        # Matplotlib finds no room for a curve that has no point and is not clipped.
        if at := [places[number] for number in missed]:
            hollow: dict[str, Any] = {"markerfacecolor": "none", "clip_on": False}
            hollow |= {"color": colour, "markersize": 5, "label": "_hollow"}
            axes.plot(at, [0.0] * len(at), "o", **hollow)
    axes.plot(places, drawn, **look)
    return drawn[-1]


def _with_bars(panel: Panel, tags: Tags) -> list[str]:
    """The first curve named, if any: bars of seven would hide each other."""
    return [name for name in panel.named(tags) if name in panel.ends][:1]


def _draw_paper(axes: Axes, panel: Panel, places: Sequence[float], hues: Mapping[str, str]) -> None:
    for name, heights in panel.paper.items():
        known = [(x, y) for x, y in zip(places, heights, strict=False) if y is not None]
        if name == FULL_SCAN:
            axes.axhline(known[0][1], color=INK, linestyle=":", linewidth=1.2, label="_paper")
        elif name in hues:
            look: dict[str, Any] = {"markerfacecolor": "none", "markersize": 6, "zorder": 5}
            axes.plot(*zip(*known, strict=True), "D", color=hues[name], **look, label="_paper")


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
