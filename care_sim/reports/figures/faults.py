"""The figures of the fault study: what a measure does as every fault grows."""

import math
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from care_sim.base.errors import counted
from care_sim.reports.cells import Cell, StudyCells
from care_sim.reports.figures.styles import FULL_STYLE, Style, bare_axes, styles
from care_sim.reports.tables.faults import policies_of
from care_sim.study.designs.faults import FAULT_PLACES, FAULTS, Fault, faults_alone
from care_sim.study.designs.variants import Place
from care_sim.study.run_config import Row

_COLUMNS = 5
"""Panels side by side; at least one place stays free for the legend."""
_FLAT = 0.02
"""A panel in which no curve moves by more than this share of the largest value of the figure shows
nothing but its level.
"""
_LINE = 190
"""Characters of the line that names such panels, as wide as the figure."""


@dataclass(frozen=True)
class CurveMeasure:
    """What a figure shows of a cell; `read` gives None where there is nothing to show."""

    name: str
    label: str
    read: Callable[[Cell], float | None]

    def value(self, cell: Cell | None) -> float | None:
        """None for a cell that was not played, nan for one without a value."""
        if cell is None:
            return None
        found = self.read(cell)
        return math.nan if found is None else found


MEASURES = (
    CurveMeasure("detection", "first detection, median, m", lambda cell: cell.detection.median),
    CurveMeasure(
        "braked", "episodes with braking, %", lambda cell: 100.0 * cell.braked / cell.episodes
    ),
    CurveMeasure(
        "clearance",
        "clearance, median, m",
        lambda cell: cell.clearance.median if cell.clearance else None,
    ),
)
Curves = Mapping[str, Sequence[float | None]]
"""Of each policy its value at every strength; None was not played, nan has no median."""


def flat_faults(curves: Mapping[str, Curves]) -> list[str]:
    """The titles of the faults, of the curves of each, that move no curve of a figure. Where that
    is so of all, the first is left out of them: it shows the levels.
    """
    heights = [height for own in curves.values() for each in own.values() for height in each]
    known = [height for height in heights if height is not None and not math.isnan(height)]
    least = _FLAT * max(known, default=0.0)
    flat = [
        title
        for title, own in curves.items()
        if not any(_moves(heights, least) for heights in own.values())
    ]
    return flat if len(flat) < len(curves) else flat[1:]


def flat_line(flat: Sequence[str]) -> str:
    """The line in the place of panels that would be flat; empty where none would."""
    if not flat:
        return ""
    return f"Moving no curve by more than {_FLAT:.0%} of the largest value: {', '.join(flat)}."


def _moves(heights: Sequence[float | None], least: float) -> bool:
    played = [height for height in heights if height is not None]
    found = [height for height in played if not math.isnan(height)]
    # A median that is lost at some strength moves to where nobody is detected.
    if len(found) not in (0, len(played)):
        return True
    return bool(found) and max(found) - min(found) > least


FAULT_FIGURES = tuple(
    f"faults-{place.scenario}-{measure.name}" for place in FAULT_PLACES for measure in MEASURES
)
"""Every figure that the study can draw."""


def fault_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """A figure for every place and measure, by name."""
    study = StudyCells(faults_alone(rows))
    drawn = styles(
        (policy, study.tags.get(policy, ())) for policy in policies_of(study) if policy != "full"
    )
    curves = _FaultPanels(study, drawn | {"full": FULL_STYLE})
    return {
        f"faults-{p.scenario}-{m.name}": curves.figure(p, m)
        for p, m in product(FAULT_PLACES, MEASURES)
    }


def fault_curves(
    study: StudyCells, policies: Iterable[str], fault: Fault, place: Place, measure: CurveMeasure
) -> Curves:
    """The curves of a panel."""
    return {
        policy: [measure.value(study.cell(level.key(place, policy))) for level in fault.levels]
        for policy in policies
    }


@dataclass(frozen=True)
class _FaultPanels:
    """Draws what was played, in the styles of the policies."""

    study: StudyCells
    drawn: dict[str, Style]

    def figure(self, place: Place, measure: CurveMeasure) -> Figure:
        """All faults in one place: an open marker at the bottom stands for a median that there is
        not.
        """
        curves = {
            fault.title: fault_curves(self.study, self.drawn, fault, place, measure)
            for fault in FAULTS
        }
        flat = flat_faults(curves)
        shown = [fault for fault in FAULTS if fault.title not in flat]
        # Rounded down and one more: a last line that is full gets one below it for the legend.
        lines = len(shown) // _COLUMNS + 1
        figure = Figure(figsize=(2.5 * _COLUMNS, 2.3 * lines + 0.7), layout="constrained")
        panels = list(figure.subplots(lines, _COLUMNS, sharey=True).flat)
        for fault, axes in zip(shown, panels, strict=False):
            self._panel(axes, fault, curves[fault.title])
        # All panels share their heights, so that setting the first sets all. Zero is in sight.
        panels[0].set_ylim(bottom=min(0.0, panels[0].get_ylim()[0]))
        for axes in panels[len(shown) :]:
            axes.set_axis_off()
        handles, names = panels[0].get_legend_handles_labels()
        panels[len(shown)].legend(handles, names, loc="center left", frameon=False, fontsize=9)
        if flat:
            told = textwrap.fill(flat_line(flat), _LINE)
            figure.supxlabel(told, x=0.01, ha="left", fontsize=9)
        figure.supylabel(measure.label, fontsize=10)
        seeds = counted(len({row["seed"] for row in self.study.rows}), "seed")
        notes = "; ".join(["open, at the bottom: not detected", *self.study.notes(self.drawn)])
        figure.suptitle(f"{place}, {seeds} ({notes})", x=0.01, ha="left", fontsize=10)
        return figure

    def _panel(self, axes: Axes, fault: Fault, curves: Curves) -> None:
        for policy, style in self.drawn.items():
            self._curve(axes, policy, style, curves[policy])
        axes.set_title(fault.title, loc="left", fontsize=9)
        axes.set_xlabel(fault.unit, fontsize=8)
        axes.set_xticks(range(len(fault.levels)), [level.label for level in fault.levels])
        axes.tick_params(labelsize=8)
        bare_axes(axes, "0.92")

    def _curve(
        self, axes: Axes, policy: str, style: Style, heights: Sequence[float | None]
    ) -> None:
        """Draw a policy over the strengths; None was not played, nan has no median."""
        # Strengths stand side by side at equal distances: their units differ from fault to fault.
        played = [(place, height) for place, height in enumerate(heights) if height is not None]
        if not played:
            return
        look: dict[str, Any] = {
            "color": style.colour,
            "marker": style.marker,
            "markersize": 4,
            "alpha": 0.85,
        }
        label = self.study.marked(policy)
        axes.plot(
            *zip(*played, strict=True), **look, linestyle=style.line, linewidth=1.3, label=label
        )
        # Matplotlib leaves nan out of the line. Open markers at the bottom show it.
        missing = [place for place, height in played if math.isnan(height)]
        if missing:
            axes.plot(
                missing,
                [0.0] * len(missing),
                **look,
                linestyle="",
                markerfacecolor="white",
                clip_on=False,
            )
