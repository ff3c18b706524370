"""How the time of a scan grows: with the budget, with the bodies, with the grid; and the figure of
it.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from care_sim.core.allocation import budget_cells
from care_sim.core.grid import AngularGrid
from care_sim.measure.bench.config import BenchConfig
from care_sim.measure.bench.ratios import BenchReport
from care_sim.measure.bench.scanning.casters import casters
from care_sim.measure.bench.scanning.moving_bodies import moving_bodies
from care_sim.measure.bench.scanning.scans import SCAN_BODIES, drawn_cells, laps
from care_sim.reports.figures.files import default_style

GROWTH_BUDGETS = (0.01, 0.03, 0.1, 0.3, 1.0)
GROWTH_COUNTS = (1, 3, 10, 30, 100, 300)
"""Numbers of bodies."""
GROWTH_GRIDS = ((512, 32), (1024, 64), (2048, 128))
_SAMPLES_SHARE = 10
"""A point of a curve has one in so many of the samples that a round has elsewhere."""

_AXES = {
    "budget": "budget (share of cells fired)",
    "bodies": "bodies",
    "grid": "grid (columns x rows), same rays",
}
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")
"""From the palette of Okabe and Ito (2008), safe for the colour-blind."""
_MARKERS = "osD^v"

Times = dict[str, float]
"""Milliseconds of a scan, by engine."""


def growth(config: BenchConfig) -> dict[str, Any]:
    """Of every axis its `values`, `labels` for people and, for every engine, `ms`: the median time
    of a scan with poses. `budget` in shares of the cells; `bodies` in number; `grid` in cells, the
    rays fired being the same in all.

    Every round goes through all points, so that what else the machine does falls on all alike.
    """
    rounds = [_round(config) for _ in range(config.repeats)]
    budgets, bodies, grids = (
        [_medians(point) for point in zip(*axis, strict=True)] for axis in zip(*rounds, strict=True)
    )
    return {
        "budget": _curves(GROWTH_BUDGETS, [f"{beta:.0%}" for beta in GROWTH_BUDGETS], budgets),
        "bodies": _curves(GROWTH_COUNTS, [str(count) for count in GROWTH_COUNTS], bodies),
        "grid": _curves(
            [columns * rows for columns, rows in GROWTH_GRIDS],
            [f"{columns} x {rows}" for columns, rows in GROWTH_GRIDS],
            grids,
        ),
    }


def _round(config: BenchConfig) -> tuple[list[Times], list[Times], list[Times]]:
    """The points of the three axes; along each, the other two are as in the targets."""
    grid = AngularGrid()
    rays = budget_cells(config.budget, grid.size)
    return (
        [
            _point(config, grid, budget_cells(beta, grid.size), SCAN_BODIES)
            for beta in GROWTH_BUDGETS
        ],
        [_point(config, grid, rays, count) for count in GROWTH_COUNTS],
        [_point(config, AngularGrid(*shape), rays, SCAN_BODIES) for shape in GROWTH_GRIDS],
    )


def _point(config: BenchConfig, grid: AngularGrid, rays: int, count: int) -> Times:
    """Milliseconds of a scan by every engine; the first scan, which warms up, does not count."""
    bodies = moving_bodies(count, config.seed)
    cells = drawn_cells(grid, rays, config.seed)
    samples = -(-config.samples // _SAMPLES_SHARE)
    with ExitStack() as opened:
        made, _ = casters(bodies.kinds, grid, opened)
        times = laps(made, bodies, cells, 1 + samples)
    return {name: 1e3 * float(np.median(seconds[1:, 2])) for name, seconds in times.items()}


def _medians(point: Sequence[Times]) -> Times:
    return {name: float(np.median([times[name] for times in point])) for name in point[0]}


def _curves(values: Sequence[float], labels: list[str], points: list[Times]) -> dict[str, Any]:
    ms = {name: [point[name] for point in points] for name in points[0]}
    return {"values": list(values), "labels": labels, "ms": ms}


@default_style()
def growth_figure(report: BenchReport) -> Figure:
    """One panel per axis and one line per engine; both scales are logarithmic."""
    figure = Figure(figsize=(10.0, 3.4), layout="constrained")
    panels = figure.subplots(1, len(_AXES), sharey=True)
    for axes, (name, label) in zip(panels, _AXES.items(), strict=True):
        curve = report["growth"][name]
        _draw(axes, curve["values"], curve["ms"])
        axes.set_xticks(curve["values"], curve["labels"])
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_xlabel(label)
    panels[0].yaxis.set_major_formatter("{x:g}")
    panels[0].set_ylabel("a scan, poses included (ms)")
    panels[0].legend(frameon=False, fontsize=8)
    scans = report["scans"]
    title = (
        f"{scans['bodies']} bodies and {scans['rays']} rays unless the axis says otherwise. "
        f"{report['machine']['processor']}"
    )
    figure.suptitle(title, x=0.01, ha="left", fontsize=8)
    return figure


def _draw(axes: Axes, values: list[float], curves: dict[str, list[float]]) -> None:
    for (engine, times), colour, marker in zip(
        curves.items(), cycle(_COLOURS), cycle(_MARKERS), strict=False
    ):
        axes.loglog(values, times, marker=marker, color=colour, label=engine, markersize=4)
    axes.grid(which="major", linewidth=0.4, alpha=0.5)
