"""Scans of the same rays at the same moving bodies by every engine, and how their time grows."""

import time
from contextlib import ExitStack

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from care_sim.core.allocation import budget_cells
from care_sim.core.grid import AngularGrid
from care_sim.reports.figures.styles import BLUE, GREEN, ORANGE, default_style, name_ends
from tests.bench.casters import SENSOR, casters, moving_bodies
from tests.bench.environments import EPISODE

BODIES = 30
"""Bodies of the scan that is published."""
REFERENCE = "bullet"
"""The engine whose answers the others are compared with."""
SAME_RANGE_M = 0.001
GROWTH = {
    "budget": (0.01, 0.03, 0.1, 0.3, 1.0),
    "bodies": (1, 3, 10, 30, 100, 300),
    "grid": ((512, 32), (1024, 64), (2048, 128)),
}
"""Along each axis, the other two are as in the published scan."""
AXES = {
    "budget": "budget (share of cells fired)",
    "bodies": "bodies",
    "grid": "grid (columns x rows), same rays",
}
COLOURS = (BLUE, ORANGE, GREEN, "#AF5BAF")


def scans(settings):
    """The figures of every engine, and what is left out in one line each.

    `scan_ms`, the medians of every round, to move all bodies and answer the rays. `same_body` and
    `same_range` are the shares of the rays that are answered as Bullet answers them.
    """
    grid = AngularGrid()
    bodies = moving_bodies(BODIES, EPISODE.seed)
    cells = drawn_cells(grid, budget_cells(EPISODE.budget, grid.size))
    with ExitStack() as opened:
        made, skipped = casters(bodies.kinds, grid, opened)
        answers = agreement(made, bodies, cells)
        rounds = [laps(made, bodies, cells, settings.samples) for _ in range(settings.repeats)]
    engines = {
        name: {
            "scan_ms": [1e3 * float(np.median(times[name])) for times in rounds],
            **answers[name],
        }
        for name in made
    }
    return {"rays": len(cells), "bodies": BODIES, "engines": engines}, skipped


def drawn_cells(grid, number):
    """`number` of the grid's cells, ascending."""
    return np.sort(np.random.default_rng(EPISODE.seed).permutation(grid.size)[:number])


def agreement(made, bodies, cells):
    """How far every engine answers as Bullet does, over bodies that have moved."""
    # The second scan is of bodies that have moved. Both warm the engines up for what is timed next.
    answers = {}
    for name, caster in made.items():
        for number in range(2):
            caster.place(bodies.at(number))
            answers[name] = caster.cast(SENSOR, cells)
    ranges, ids = answers[REFERENCE]
    return {
        name: {
            "same_body": float(np.mean(others == ids)),
            "same_range": float(np.mean(np.isclose(found, ranges, rtol=0, atol=SAME_RANGE_M))),
        }
        for name, (found, others) in answers.items()
    }


def laps(made, bodies, cells, samples):
    """(samples,) seconds to place the bodies and cast, of every engine."""
    # The engines take turns, scan by scan: what else the machine does falls on all alike.
    times = {name: np.empty(samples) for name in made}
    for number in range(samples):
        poses = bodies.at(number)
        for name, caster in made.items():
            started = time.perf_counter()
            caster.place(poses)
            caster.cast(SENSOR, cells)
            times[name][number] = time.perf_counter() - started
    return times


def growth(settings):
    """The `values` of every axis (of the grid, cells), `labels` for people and, for every engine,
    `ms`: the median time of a scan with poses.

    Every round goes through all points, so that what else the machine does falls on all alike. A
    point has a tenth of the samples.
    """
    rounds = [
        {
            axis: [_point(settings, axis, value) for value in values]
            for axis, values in GROWTH.items()
        }
        for _ in range(settings.repeats)
    ]
    curves = {}
    for axis, values in GROWTH.items():
        times = {
            name: np.median([[p[name] for p in told[axis]] for told in rounds], axis=0).tolist()
            for name in rounds[0][axis][0]
        }
        curves[axis] = {
            "values": [*values],
            "labels": [str(value) for value in values],
            "ms": times,
        }
    curves["budget"]["labels"] = [f"{budget:.0%}" for budget in GROWTH["budget"]]
    curves["grid"]["labels"] = [f"{columns} x {rows}" for columns, rows in GROWTH["grid"]]
    curves["grid"]["values"] = [columns * rows for columns, rows in GROWTH["grid"]]
    return curves


def _point(settings, axis, value):
    """Milliseconds of a scan by every engine; the first scan, which warms up, does not count."""
    grid = AngularGrid(*value) if axis == "grid" else AngularGrid()
    budget = value if axis == "budget" else EPISODE.budget
    bodies = moving_bodies(value if axis == "bodies" else BODIES, EPISODE.seed)
    cells = drawn_cells(grid, budget_cells(budget, AngularGrid().size))
    with ExitStack() as opened:
        made, _ = casters(bodies.kinds, grid, opened)
        times = laps(made, bodies, cells, 1 - (-settings.samples // 10))
    return {name: 1e3 * float(np.median(seconds[1:])) for name, seconds in times.items()}


@default_style()
def growth_figure(report):
    """Draw one panel per axis and one line per engine. Both scales are logarithmic."""
    figure = Figure(figsize=(10.0, 3.4), layout="constrained")
    panels = figure.subplots(1, len(AXES), sharey=True)
    for axes, (name, label) in zip(panels, AXES.items(), strict=True):
        curve = report["growth"][name]
        for ms, colour, marker in zip(curve["ms"].values(), COLOURS, "osD^", strict=False):
            axes.loglog(curve["values"], ms, marker=marker, color=colour, markersize=4)
        axes.set_xticks(curve["values"], curve["labels"])
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_xlabel(label)
    panels[0].yaxis.set_major_formatter("{x:g}")
    panels[0].set_ylabel("time per scan (ms)")
    scan = report["scans"]
    title = f"{scan['bodies']} bodies and {scan['rays']:,} rays, unless the axis varies them"
    figure.suptitle(title, x=0.01, ha="left")
    ends = zip(curve["ms"].items(), COLOURS, strict=False)
    name_ends(figure, {panels[-1]: {engine: (ms[-1], colour) for (engine, ms), colour in ends}})
    return figure
