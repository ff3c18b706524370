"""The figures of the fault study: what a measure does as every fault grows, a panel a fault."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from care_sim.study.episode import Row
from care_sim.study.factors import Place
from care_sim.study.faults import FAULTS, PLACES, Fault, policies_of
from care_sim.study.played import Played
from care_sim.study.styles import FULL, Style, styles
from care_sim.study.summary import Cell, Key

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
    drawn = styles((policy, played.tags.get(policy, ())) for policy in policies_of(played) if policy != "full")
    curves = Curves(played, drawn | {"full": FULL})
    return {f"faults-{p.scenario}-{m.name}": curves.figure(p, m) for p, m in product(PLACES, MEASURES)}


@dataclass(frozen=True)
class Curves:
    """Draws what was played, in the styles of the policies."""

    played: Played
    drawn: dict[str, Style]

    def figure(self, place: Place, measure: Measure) -> Figure:
        """All faults in one place: an open marker at the bottom stands for a median that there is not."""
        lines = math.ceil(len(FAULTS) / COLUMNS)
        figure = Figure(figsize=(2.6 * COLUMNS, 2.1 * lines + 0.6), layout="constrained")
        panels = list(figure.subplots(lines, COLUMNS, sharey=True).flat)
        for fault, axes in zip(FAULTS, panels, strict=False):
            self._panel(axes, fault, place, measure)
        for axes in panels[len(FAULTS) :]:
            axes.set_axis_off()
        handles, names = panels[0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside lower right", ncols=len(names), frameon=False, fontsize=9)
        figure.supylabel(measure.label, fontsize=10)
        seeds = len({row["seed"] for row in self.played.rows})
        notes = "; ".join(["open at the bottom: not detected", *self.played.notes(self.drawn)])
        figure.suptitle(f"{place}, {seeds} seeds ({notes})", x=0.01, ha="left", fontsize=10)
        return figure

    def _panel(self, axes: Axes, fault: Fault, place: Place, measure: Measure) -> None:
        for policy, style in self.drawn.items():
            self._curve(axes, policy, style, [(s.value, s.level.key(place, policy)) for s in fault.strengths], measure)
        axes.set_title(fault.title, loc="left", fontsize=9)
        axes.set_xlabel(fault.unit, fontsize=8)
        axes.set_xticks([strength.value for strength in fault.strengths])
        axes.tick_params(labelsize=8)
        axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(axis="y", color="0.92")
        axes.set_axisbelow(True)

    def _curve(
        self, axes: Axes, policy: str, style: Style, keys: Sequence[tuple[float, Key]], measure: Measure
    ) -> None:
        cells = [(strength, self.played.cell(key)) for strength, key in keys]
        values = [(strength, measure.read(cell)) for strength, cell in cells if cell]
        look: dict[str, Any] = {"color": style.colour, "marker": style.marker, "markersize": 4, "alpha": 0.85}
        strengths, heights = [strength for strength, _ in values], [height for _, height in values]
        label = self.played.marked(policy)
        axes.plot(strengths, heights, **look, linestyle=style.line, linewidth=1.3, label=label)
        missing = [strength for strength, height in values if math.isnan(height)]
        axes.plot(missing, [0.0] * len(missing), **look, linestyle="", markerfacecolor="white", clip_on=False)
