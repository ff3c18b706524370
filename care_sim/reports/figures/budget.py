"""The paper's figure of a sweep: first detection against the budget, one curve per policy."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.transforms import ScaledTranslation

from care_sim.base.errors import counted, percent
from care_sim.reports.cells import Cell, summarise
from care_sim.reports.figures.styles import (
    APART,
    CLOSED_LOOP_DODGE,
    FULL_STYLE,
    Style,
    bare_axes,
    styles,
)
from care_sim.reports.formatting import marked, tag_notes
from care_sim.study.run_config import Row

BUDGET_FIGURES = ("{world}-budget",)
"""Every figure that a sweep can draw of a scenario."""
_FEW = 5
"""Up to so many policies their quartiles are drawn in full strength."""


class _NamedCurve(NamedTuple):
    """A curve and the metres at its right end."""

    line: Line2D
    end: float


def sweep_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """A figure for every scenario that was run without further conditions at several budgets, by
    name.
    """
    cells = [cell for cell in summarise(rows) if not cell.setting.conditions]
    scenarios = sorted({cell.setting.world for cell in cells})
    by_scenario = {
        name: [cell for cell in cells if cell.setting.world == name] for name in scenarios
    }
    return {
        f"{own[0].setting.slug}-budget": budget_figure(own)
        for own in by_scenario.values()
        if len(_budgets(own)) > 1
    }


def budget_figure(cells: Sequence[Cell]) -> Figure:
    """Median first-detection distance in metres against the budget, with bars from quartile to
    quartile; the full scan is a line.

    A median that is not detected is an open marker at the bottom, with the number of episodes
    without a detection. A bar whose lower quartile is not detected reaches the bottom.
    """
    policies = dict.fromkeys((cell.policy, cell.tags) for cell in cells if cell.policy != "full")
    # Room in height for one line of the legend per policy.
    figure = Figure(figsize=(8.2, 3.6 + 0.16 * max(len(policies), _FEW)), layout="constrained")
    axes = figure.add_subplot()
    # Budgets from 1 to 35% are spread evenly by their ratios.
    axes.set_xscale("log")
    _name_curves(figure, _draw(axes, cells, styles(policies)))
    budgets = _budgets(cells)
    axes.set_xticks(budgets, [percent(budget) for budget in budgets])
    axes.minorticks_off()
    counts = sorted({cell.episodes for cell in cells})
    most = counted(counts[-1], "seed")
    seeds = most if len(counts) == 1 else f"{counts[0]} to {most}"
    axes.set_title(f"{cells[0].setting.world}: {seeds} a point", loc="left", fontsize=10)
    notes = ["budget (share of cells fired)", APART, *tag_notes(tags for _, tags in policies)]
    axes.set_xlabel("\n".join(notes))
    axes.set_ylabel("first detection (m, median and quartiles)")
    bare_axes(axes, "0.92")
    return figure


def _draw(axes: Axes, cells: Sequence[Cell], drawn: dict[str, Style]) -> list[_NamedCurve]:
    curves = [
        _full_scan(axes, cell)
        for cell in cells
        if cell.policy == "full" and cell.detection.median is not None
    ]
    for number, (policy, style) in enumerate(drawn.items()):
        own = [cell for cell in cells if cell.policy == policy]
        shift = CLOSED_LOOP_DODGE.factor(number, len(drawn))
        curves.append(_curve(axes, own, shift, style, 1.0 if len(drawn) <= _FEW else 0.4))
    # Before the open markers, which stand on the bottom of the axes.
    axes.set_ylim(bottom=0.0)
    _undetected(axes, cells, drawn)
    return curves


def _full_scan(axes: Axes, cell: Cell) -> _NamedCurve:
    height = cell.detection.median or 0.0
    line = axes.axhline(
        height,
        color=FULL_STYLE.colour,
        linestyle=FULL_STYLE.line,
        linewidth=1.2,
        label="full scan",
        zorder=1,
    )
    return _NamedCurve(line, height)


def _curve(
    axes: Axes, cells: Sequence[Cell], shift: float, style: Style, strength: float
) -> _NamedCurve:
    """Draw the detected medians of a policy and their quartiles."""
    places = [cell.budget * shift for cell in cells]
    medians = [
        # nan breaks the line where the median is not detected.
        math.nan if cell.detection.median is None else cell.detection.median
        for cell in cells
    ]
    bars: dict[str, Any] = {
        "color": style.colour,
        "alpha": strength,
        "linewidth": 1.3,
        "marker": "_",
        "markersize": 5,
    }
    for place, values in zip(places, (cell.detection for cell in cells), strict=True):
        if values.median is not None and values.high is not None:
            axes.plot([place, place], [values.low or 0.0, values.high], **bars)
    look: dict[str, Any] = {
        "color": style.colour,
        "linestyle": style.line,
        "marker": style.marker,
        "linewidth": 1.5,
    }
    (line,) = axes.plot(places, medians, label=marked(cells[0].policy, cells[0].tags), **look)
    return _NamedCurve(line, cells[-1].detection.median or 0.0)


def _undetected(axes: Axes, cells: Sequence[Cell], drawn: dict[str, Style]) -> None:
    """Open markers of the medians that are not detected, side by side at the bottom."""
    for budget in _budgets(cells):
        missed = [
            c
            for c in cells
            if c.budget == budget and c.policy in drawn and c.detection.median is None
        ]
        for number, cell in enumerate(missed):
            _open_marker(axes, cell, drawn[cell.policy], 11.0 * (number - (len(missed) - 1) / 2))


def _open_marker(axes: Axes, cell: Cell, style: Style, aside: float) -> None:
    """An open marker at the bottom, `aside` points to the right of its budget, with its count
    above.
    """
    figure = axes.get_figure(root=True)
    assert figure is not None
    # A shift in points: side by side whatever the scale of the axes. 72 points are an inch.
    moved = axes.transData + ScaledTranslation(aside / 72, 0, figure.dpi_scale_trans)
    hollow: dict[str, Any] = {
        "marker": style.marker,
        "markeredgecolor": style.colour,
        "markerfacecolor": "white",
    }
    axes.plot([cell.budget], [0.0], **hollow, clip_on=False, transform=moved, zorder=5)
    axes.annotate(
        f"{cell.never}/{cell.met} never",
        (cell.budget, 0.0),
        (aside, 7),
        textcoords="offset points",
        rotation=90,
        ha="center",
        va="bottom",
        size=7,
        color=style.colour,
    )


def _name_curves(figure: Figure, curves: Sequence[_NamedCurve]) -> None:
    """Name the curves beside the axes, in the order of their right ends."""
    # The eye finds a name at about the height of its curve.
    handles = [curve.line for curve in sorted(curves, key=lambda curve: curve.end, reverse=True)]
    figure.legend(
        handles=handles, loc="outside right upper", frameon=False, fontsize=9, handlelength=3
    )


def _budgets(cells: Sequence[Cell]) -> list[float]:
    return sorted({cell.budget for cell in cells if cell.policy != "full"})
