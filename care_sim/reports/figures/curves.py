"""Figures of curves: at most seven of a panel in colour, each named at its right end, the rest thin
and grey.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from textwrap import fill, wrap
from typing import Any, Literal, NamedTuple, TypeVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from care_sim.base.errors import percent
from care_sim.reports.engine.controls import BEST_CONTROL, is_control
from care_sim.reports.figures.styles import CALM, colours, name_ends
from care_sim.reports.formatting import MARKS, marked, tag_notes
from care_sim.study.run_config import FULL, REFERENCE

FULL_SCAN = "full scan"
MOST_NAMED = 7
"""Curves of a panel that have a name and a colour."""
BUDGET = "budget (share of cells fired)"
_CEILINGS = (FULL_SCAN, BEST_CONTROL)
"""Dashed curves: references of comparison."""
_FIRST = (REFERENCE, "history", "all-camera", *_CEILINGS)
_RULE = "named: the paper's policies, the best control, the best others by mean; grey: all others"
_HOLLOW = "hollow, at 0: not detected"
_PAPER = "diamonds, dotted line: what the paper reports"
_SIZES = {1: (6.5, 3.6), 2: (4.6, 3.3)}
_NARROW = (3.4, 2.4)
"""Width and height in inches of a panel with its names, by the number of panels, and of more."""
_NOTE_INCHES = 0.17
_INCH_LETTERS = 12
"""Letters of a note on an inch."""
_TURNED = 6
"""Letters of a tick above which ticks are turned."""

Tags = Mapping[str, tuple[str, ...]]
_Tick = TypeVar("_Tick")


class Point(NamedTuple):
    """A height, nan where the actor was not detected, and the ends of its interval."""

    height: float
    ends: tuple[float, float] | None = None

    @property
    def drawn(self) -> float:
        """Return the value that is drawn: 0 where nothing was detected."""
        return 0.0 if math.isnan(self.height) else self.height


Curve = Sequence[Point | None]
"""Point by tick, None where it was not played."""


def point(height: float | None) -> Point | None:
    """A point without an interval; None of None."""
    return None if height is None else Point(height)


@dataclass(frozen=True)
class Panel:
    """The curves of one panel over its ticks.

    `places` of the ticks on a logarithmic axis; without them the ticks are side by side. `paper`
    holds what the paper reports of a curve.
    """

    title: str
    ticks: Sequence[str]
    curves: Mapping[str, Curve]
    label: str = ""
    places: Sequence[float] = ()
    paper: Mapping[str, Curve] = field(default_factory=dict)
    unit: str = ""
    less_is_better: bool = False

    @classmethod
    def of(
        cls,
        title: str,
        names: Iterable[str],
        ticks: Mapping[str, _Tick],
        read: Callable[[str, _Tick], Point | None],
        **rest: Any,
    ) -> "Panel":
        """A curve of every name, which `read` gives tick by tick; none of what was not played."""
        found = {name: [read(name, tick) for tick in ticks.values()] for name in names}
        curves = {
            FULL_SCAN if name == FULL else name: curve
            for name, curve in found.items()
            if any(curve)
        }
        return cls(title, [*ticks], curves, **rest)

    @classmethod
    def by_budget(
        cls,
        title: str,
        names: Iterable[str],
        budgets: Sequence[float],
        read: Callable[[str, float], Point | None],
        **rest: Any,
    ) -> "Panel":
        """The same with a tick at every budget."""
        ticks = {percent(budget): budget for budget in budgets}
        return cls.of(title, names, ticks, read, places=budgets, **rest)

    def named(self, tags: Tags) -> list[str]:
        """The curves with a name: the paper's policies, the best control, then the best others by
        their mean; those that no car can have come last.
        """
        means = {
            name: np.mean([each.drawn for each in curve if each])
            for name, curve in self.curves.items()
            if any(curve)
        }
        ranked = sorted(means, key=lambda name: means[name], reverse=not self.less_is_better)
        ranked.sort(key=lambda name: bool({*tags.get(name, ())} & {*MARKS}))
        control = next((name for name in ranked if is_control(tags.get(name, ()))), REFERENCE)
        first = [name for name in (*_FIRST, control) if name in means]
        return [*dict.fromkeys([*first, *ranked])][:MOST_NAMED]


def curves_figure(
    name: str,
    title: str,
    panels: Iterable[Panel],
    tags: Tags,
    notes: Sequence[str] = (),
    columns: int = 3,
    share: bool | Literal["row"] = False,
    from_zero: bool = True,
    bars: str = "",
) -> dict[str, Figure]:
    """The figure by its name: all panels with curves, `columns` of them side by side; no figure
    without any. `share` whether they have one scale. `tags` of the policies among the curves,
    `notes` below the panels. `bars` says what the ends of points are; without it no interval is
    drawn.
    """
    panels = [panel for panel in panels if panel.curves]
    if not panels:
        return {}
    columns = min(columns, len(panels))
    lines = math.ceil(len(panels) / columns)
    width, height = _SIZES.get(len(panels), _NARROW)
    width *= columns
    # Bars of seven curves would hide each other: the first has them.
    leaders = dict.fromkeys(each.named(tags)[0] for each in panels if bars)
    drawn = [f"bars: {bars} of {' and '.join(leaders)}"] if leaders else []
    said = [*notes, *drawn, *_on_marks(panels, tags)]
    below = [line for note in said for line in wrap(note, int(_INCH_LETTERS * width))]
    size = (width, height * lines + 0.4 + _NOTE_INCHES * len(below))
    figure = Figure(figsize=size, layout="constrained")
    # Ticks below each other are named once.
    alike = len({tuple(panel.ticks) for panel in panels}) == 1 and len(panels) == lines * columns
    across = figure.subplots(lines, columns, squeeze=False, sharex=alike, sharey=share)
    grid = across.ravel().tolist()
    hues = colours(dict.fromkeys(name for panel in panels for name in panel.curves))
    named = [_draw(*each, tags, hues, bool(bars)) for each in zip(grid, panels, strict=False)]
    for axes in grid[len(panels) :]:
        axes.set_axis_off()
    for axes in grid[: len(panels)] if from_zero else ():
        axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    figure.suptitle(fill(title, int(_INCH_LETTERS * width)), x=0.01, ha="left")
    figure.supxlabel("\n".join(below), fontsize=9)
    name_ends(figure, dict(zip(grid, named, strict=False)))
    return {name: figure}


def _on_marks(panels: Sequence[Panel], tags: Tags) -> list[str]:
    """Return the notes that explain the marks of these panels."""
    shown = [(name, panel.curves[name]) for panel in panels for name in panel.named(tags)]
    missed = any(each and math.isnan(each.height) for _, curve in shown for each in curve)
    return [
        *([_RULE] if any(len(each.curves) > len(each.named(tags)) for each in panels) else []),
        *([_HOLLOW] if missed else []),
        *([_PAPER] if any(panel.paper for panel in panels) else []),
        *tag_notes(tags.get(name, ()) for name, _ in shown),
    ]


def _draw(
    axes: Axes, panel: Panel, tags: Tags, hues: Mapping[str, str], bars: bool
) -> dict[str, tuple[float, str]]:
    """Draw a panel; the right ends of its named curves, each with its colour."""
    named = panel.named(tags)
    ends = {}
    places = [*(panel.places or range(len(panel.ticks)))]
    for name, curve in panel.curves.items():
        played = [(place, each) for place, each in zip(places, curve, strict=True) if each]
        label = marked(name, tags.get(name, ()))
        hue = hues[name] if name in named else CALM
        _curve(axes, played, hue, label, name in named)
        if name in named:
            ends[label] = played[-1][1].drawn, hue
        for place, each in played if bars and name == named[0] else ():
            if each.ends:
                axes.vlines(place, *each.ends, color=hue, linewidth=1.2, zorder=2)
    _draw_paper(axes, panel, places, {name: hues[name] for name in named})
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
    axes: Axes, points: Sequence[tuple[float, Point]], colour: str, label: str, named: bool
) -> None:
    look: dict[str, Any] = {"color": colour, "label": label, "linewidth": 0.7, "alpha": 0.6}
    missed = [place for place, each in points if math.isnan(each.height)]
    if named:
        found = [number for number, (place, _) in enumerate(points) if place not in missed]
        look |= {"linewidth": 1.6, "alpha": 1.0, "marker": "o", "markersize": 4}
        look |= {"markevery": found, "zorder": 4 if label == REFERENCE else 3}
        if label in _CEILINGS:
            look |= {"linestyle": "--", "linewidth": 1.2, "marker": "", "zorder": 1}
        # Matplotlib finds no room for a curve that has no point and is not clipped.
        if missed:
            hollow: dict[str, Any] = {"markerfacecolor": "none", "clip_on": False}
            hollow |= {"color": colour, "markersize": 5, "label": "_hollow"}
            axes.plot(missed, [0.0] * len(missed), "o", **hollow)
    axes.plot([place for place, _ in points], [each.drawn for _, each in points], **look)


def _draw_paper(axes: Axes, panel: Panel, places: Sequence[float], hues: Mapping[str, str]) -> None:
    look: dict[str, Any] = {"markerfacecolor": "none", "markersize": 6, "zorder": 5}
    for name, curve in panel.paper.items():
        known = [(x, each.height) for x, each in zip(places, curve, strict=True) if each]
        form = ":" if name == FULL_SCAN else "D"
        if name in hues:
            axes.plot(*zip(*known, strict=True), form, color=hues[name], **look, label="_paper")
