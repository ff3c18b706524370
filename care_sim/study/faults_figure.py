"""The figures of the fault study: what a measure does as every fault grows, a panel a fault."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from care_sim.study.episode import Row
from care_sim.study.factors import Place
from care_sim.study.faults import FAULTS, PLACES, Fault, Played
from care_sim.study.styles import FULL, Style, styles
from care_sim.study.summary import Cell

COLUMNS = 4
"""Panels side by side."""


@dataclass(frozen=True)
class Measure:
    """What a figure shows of a cell; nan where there is nothing to show."""

    name: str
    label: str
    read: Callable[[Cell], float]


def _detection(cell: Cell) -> float:
    return math.nan if cell.detection.median is None else cell.detection.median


def _braked(cell: Cell) -> float:
    return 100.0 * cell.braked / cell.episodes


def _clearance(cell: Cell) -> float:
    return math.nan if cell.clearance is None or cell.clearance.median is None else cell.clearance.median


MEASURES = (
    Measure("detection", "first detection, median, m", _detection),
    Measure("braked", "episodes with braking, %", _braked),
    Measure("clearance", "clearance, median, m", _clearance),
)
NAMES = tuple(f"faults-{place.scenario}-{measure.name}" for place in PLACES for measure in MEASURES)
"""Every figure that the study can draw."""


def fault_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """A figure for every place and measure, by name."""
    played = Played(rows)
    drawn = styles((policy, ()) for policy in played.policies if policy != "full") | {"full": FULL}
    return {
        f"faults-{place.scenario}-{measure.name}": _figure(place, measure, played, drawn)
        for place in PLACES
        for measure in MEASURES
    }


def _figure(place: Place, measure: Measure, played: Played, drawn: dict[str, Style]) -> Figure:
    lines = math.ceil(len(FAULTS) / COLUMNS)
    figure = Figure(figsize=(2.6 * COLUMNS, 2.1 * lines + 0.6), layout="constrained")
    panels = figure.subplots(lines, COLUMNS, sharey=True).flat
    for fault, axes in zip(FAULTS, panels, strict=False):
        _panel(axes, fault, place, measure, played, drawn)
    for axes in list(panels)[len(FAULTS) :]:
        axes.set_axis_off()
    handles, names = panels[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower right", ncols=len(names), frameon=False, fontsize=9)
    figure.supylabel(measure.label, fontsize=10)
    figure.suptitle(f"{place}", x=0.01, ha="left", fontsize=11)
    return figure


def _panel(axes: Axes, fault: Fault, place: Place, measure: Measure, played: Played, drawn: dict[str, Style]) -> None:
    for policy, style in drawn.items():
        cells = [(strength.value, played.cell(place, policy, strength)) for strength in fault.strengths]
        values = [(strength, measure.read(cell)) for strength, cell in cells if cell]
        look: dict[str, Any] = {
            "color": style.colour,
            "marker": style.marker,
            "linestyle": style.line,
            "linewidth": 1.3,
        }
        axes.plot(*zip(*values, strict=True), **look, markersize=4, alpha=0.85, label=policy)
    axes.set_title(fault.title, loc="left", fontsize=9)
    axes.set_xlabel(fault.unit, fontsize=8)
    axes.tick_params(labelsize=8)
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.set_ylim(bottom=0.0)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="y", color="0.92")
    axes.set_axisbelow(True)
