"""How the time of a scan grows: with the budget, with the bodies, with the grid."""

from collections.abc import Sequence
from contextlib import ExitStack
from typing import Any

import numpy as np

from care_sim.core.allocation import budget_cells
from care_sim.core.grid import AngularGrid
from care_sim.measure.bench.config import BenchConfig
from care_sim.measure.bench.scanning.casters import casters
from care_sim.measure.bench.scanning.scans import BODIES, drawn_cells, laps
from care_sim.measure.bench.scanning.street import street

BUDGETS = (0.01, 0.03, 0.1, 0.3, 1.0)
COUNTS = (1, 3, 10, 30, 100, 300)
GRIDS = ((512, 32), (1024, 64), (2048, 128))
SHARE = 10
"""A point of a curve has this share of the samples that a round has elsewhere."""

Times = dict[str, float]


def growth(config: BenchConfig) -> dict[str, Any]:
    """Of every axis its `values`, `labels` for people and, for every engine, `ms`: the median time
    of a scan with poses. `budget` in shares of the cells; `bodies` in number; `grid` in cells, the
    rays fired being the same in all.

    Every round goes through all points, so that what else the machine does falls on all alike.
    """
    rounds = [_round(config) for _ in range(config.repeats)]
    budgets, bodies, grids = (
        [_middle(point) for point in zip(*axis, strict=True)] for axis in zip(*rounds, strict=True)
    )
    return {
        "budget": _curves(BUDGETS, [f"{beta:.0%}" for beta in BUDGETS], budgets),
        "bodies": _curves(COUNTS, [str(count) for count in COUNTS], bodies),
        "grid": _curves([a * e for a, e in GRIDS], [f"{a} x {e}" for a, e in GRIDS], grids),
    }


def _round(config: BenchConfig) -> tuple[list[Times], list[Times], list[Times]]:
    """The points of the three axes."""
    grid = AngularGrid()
    rays = budget_cells(config.budget, grid.size)
    return (
        [_point(config, grid, budget_cells(beta, grid.size), BODIES) for beta in BUDGETS],
        [_point(config, grid, rays, count) for count in COUNTS],
        [_point(config, AngularGrid(*shape), rays, BODIES) for shape in GRIDS],
    )


def _middle(point: Sequence[Times]) -> Times:
    return {name: float(np.median([times[name] for times in point])) for name in point[0]}


def _curves(values: Sequence[float], labels: list[str], points: list[Times]) -> dict[str, Any]:
    ms = {name: [point[name] for point in points] for name in points[0]}
    return {"values": list(values), "labels": labels, "ms": ms}


def _point(config: BenchConfig, grid: AngularGrid, rays: int, count: int) -> Times:
    """Milliseconds of a scan by every engine; the first scan, which warms up, does not count."""
    bodies, cells = street(count, config.seed), drawn_cells(grid, rays, config.seed)
    with ExitStack() as opened:
        made, _ = casters(bodies.kinds, grid, opened)
        times = laps(made, bodies, cells, 1 + -(-config.samples // SHARE))
    return {name: 1e3 * float(np.median(seconds[1:, 2])) for name, seconds in times.items()}
