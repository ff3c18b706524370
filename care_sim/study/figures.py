"""Figures of a study, as pure functions of its rows."""

from collections.abc import Container, Sequence
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from care_sim.scenarios import SCENARIOS
from care_sim.study import crowding
from care_sim.study.episode import Row
from care_sim.study.summary import Cell, summarise
from care_sim.study.tables import percent

STYLES = {
    "history": ("#E69F00", "s"),
    "all-camera": ("#D55E00", "v"),
    "care": ("#0072B2", "o"),
    "care-sbf": ("#009E73", "D"),
    "random": ("#CC79A7", "X"),
}
"""Colour and marker of every policy, from the palette of Okabe and Ito (2008), safe for the colour-blind."""
_OTHER = ("#56B4E9", "P")
_DODGE = 0.015
"""Share of the axis by which neighbouring policies are moved apart, so that equal curves stay visible."""


NAMES = (*(f"{scenario}-budget" for scenario in SCENARIOS), "crowding")
"""Every figure that a study can draw."""
_FORMATS = (".png", ".svg")


def remove_others(folder: Path, kept: Container[str]) -> None:
    """Remove the figures of an earlier study from a folder, all but those of the names `kept`."""
    for name in NAMES:
        for suffix in _FORMATS if name not in kept else ():
            (folder / f"{name}{suffix}").unlink(missing_ok=True)


def save(figure: Figure, stem: Path) -> None:
    """Write a figure as PNG and SVG."""
    figure.savefig(stem.with_suffix(".png"), dpi=200)
    with rc_context({"svg.hashsalt": stem.name}):
        figure.savefig(stem.with_suffix(".svg"), metadata={"Date": None})


def study_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Figures by name: the detection distance against the budget for every scenario that was run at several
    budgets; in the crowding study, against the number of vehicles.
    """
    if len({row.get(crowding.COLUMN) for row in rows}) > 1:
        return {"crowding": crowding_figure(rows)}
    cells = summarise(rows)
    faultless = {cell.setting.scenario for cell in cells if not cell.setting.conditions}
    budgets = {s: {c.budget for c in cells if c.setting.scenario == s and c.policy != "full"} for s in faultless}
    return {f"{s}-budget": budget_figure(rows, s) for s in sorted(faultless) if len(budgets[s]) > 1}


def budget_figure(rows: Sequence[Row], scenario: str) -> Figure:
    """The paper's figure: median first-detection distance in metres against the budget, interquartile bars,
    the median of the full scan as a line. Never detected ranks as 0 m; the count stands at the point.
    """
    cells = [c for c in summarise(rows) if c.setting.scenario == scenario and not c.setting.conditions]
    figure = Figure(figsize=(7.2, 4.4), layout="constrained")
    axes = figure.add_subplot()
    axes.set_xscale("log")
    labels: list[tuple[float, str, str]] = []
    policies = list(dict.fromkeys(cell.policy for cell in cells if cell.policy != "full"))
    for number, policy in enumerate(policies):
        shift = 1 + 2 * _DODGE * (number - (len(policies) - 1) / 2)
        labels.append(_curve(axes, [c for c in cells if c.policy == policy], shift))
    for cell in cells:
        if cell.policy == "full":
            axes.axhline(cell.detection.median, color="0.35", linestyle="--", linewidth=1.2, zorder=1)
            labels.append((cell.detection.median, "full scan", "0.35"))
    _label_right(axes, labels)
    budgets = sorted({cell.budget for cell in cells if cell.policy != "full"})
    axes.set_xticks(budgets, [percent(budget) for budget in budgets])
    axes.minorticks_off()
    _finish(axes, "budget (share of cells fired)", f"{scenario}: {_episodes(cells)} seeds a point")
    return figure


def crowding_figure(rows: Sequence[Row]) -> Figure:
    """Median first-detection distance in metres against the standing vehicles, one panel a budget."""
    tagged = [{**row, crowding.COLUMN: crowding.vehicles_of(row)} for row in rows]
    budgets = sorted({row["budget"] for row in rows if row["policy"] != "full"})
    figure = Figure(figsize=(3.2 * len(budgets) + 0.8, 3.8), layout="constrained")
    panels = figure.subplots(1, len(budgets), sharey=True, squeeze=False)[0]
    for panel, budget in zip(panels, budgets, strict=True):
        _crowding_panel(panel, [row for row in tagged if row["policy"] == "full" or row["budget"] == budget])
        _finish(panel, "standing vehicles", f"budget {percent(budget)}")
    for panel in panels[1:]:
        panel.set_ylabel("")
    return figure


def _crowding_panel(axes: Axes, rows: Sequence[Row]) -> None:
    labels = []
    for number, policy in enumerate(sorted({row["policy"] for row in rows})):
        by_count = [
            (count, summarise([row for row in rows if row["policy"] == policy and row[crowding.COLUMN] == count]))
            for count in sorted({row[crowding.COLUMN] for row in rows})
        ]
        points = [(count + 0.12 * (number - 1), cells[0]) for count, cells in by_count if cells]
        labels.append(_line(axes, [x for x, _ in points], [cell for _, cell in points]))
    _label_right(axes, labels)


def _curve(axes: Axes, cells: Sequence[Cell], shift: float) -> tuple[float, str, str]:
    return _line(axes, [cell.budget * shift for cell in cells], cells)


def _line(axes: Axes, places: Sequence[float], cells: Sequence[Cell]) -> tuple[float, str, str]:
    """Draw one policy; returns where its label belongs, its text and colour."""
    policy = cells[0].policy
    colour, marker = ("0.35", "_") if policy == "full" else STYLES.get(policy.split()[0], _OTHER)
    medians = [cell.detection.median for cell in cells]
    below = [cell.detection.median - cell.detection.low for cell in cells]
    above = [cell.detection.high - cell.detection.median for cell in cells]
    style = "--" if policy == "full" else "-"
    axes.errorbar(
        places, medians, [below, above], color=colour, marker=marker, linestyle=style, capsize=3, linewidth=1.5
    )
    for place, cell in zip(places, cells, strict=True):
        if cell.never:
            at = (place, cell.detection.median)
            upright: dict[str, Any] = {"rotation": 90, "ha": "center", "va": "bottom", "size": 8, "color": colour}
            axes.annotate(f"{cell.never} never", at, (0, 6), textcoords="offset points", **upright)
    return medians[-1], policy, colour


def _label_right(axes: Axes, labels: Sequence[tuple[float, str, str]]) -> None:
    """Name the curves at their right ends, pushed apart where they meet."""
    top = axes.get_ylim()[1]
    gap, height = 0.06 * top, top
    for value, text, colour in sorted(labels, reverse=True):
        height = min(value, height - gap)
        axes.annotate(text, (1.02, height), xycoords=("axes fraction", "data"), color=colour, va="center")


def _finish(axes: Axes, xlabel: str, title: str) -> None:
    axes.set_xlabel(xlabel)
    axes.set_ylabel("first detection (m, median and quartiles)")
    axes.set_title(title, loc="left", fontsize=10)
    axes.set_ylim(bottom=0.0)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="y", color="0.92")
    axes.set_axisbelow(True)


def _episodes(cells: Sequence[Cell]) -> str:
    counts = sorted({cell.episodes for cell in cells})
    return str(counts[0]) if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
