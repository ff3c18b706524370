"""Scans of the same rays at the same moving bodies by every engine."""

import time
from collections.abc import Mapping
from contextlib import ExitStack
from typing import Any

import numpy as np

from care_sim.core.allocation import budget_cells
from care_sim.core.arrays import Floats
from care_sim.core.grid import AngularGrid, Cells
from care_sim.measure.bench.config import BenchConfig
from care_sim.measure.bench.scanning.casters import Caster, casters
from care_sim.measure.bench.scanning.moving_bodies import SENSOR, MovingBodies, moving_bodies
from care_sim.measure.parity.answers import SAME_RANGE_M

SCAN_BODIES = 30
"""Bodies of the scan that the targets speak of."""
REFERENCE_ENGINE = "bullet"
"""The engine whose answers the others are compared with."""


def scans(config: BenchConfig) -> tuple[dict[str, Any], list[str]]:
    """The figures of every engine, and what is left out in one line each.

    Medians of every round in ms: `poses_ms` to move all bodies, `cast_ms` to answer the rays,
    `scan_ms` for both. `rays_per_s` of the scan. `same_body` and `same_range` are the shares of the
    rays that are answered as Bullet answers them.
    """
    grid = AngularGrid()
    bodies = moving_bodies(SCAN_BODIES, config.seed)
    cells = drawn_cells(grid, budget_cells(config.budget, grid.size), config.seed)
    with ExitStack() as opened:
        made, skipped = casters(bodies.kinds, grid, opened)
        answers = agreement(made, bodies, cells)
        rounds = [laps(made, bodies, cells, config.samples) for _ in range(config.repeats)]
    figures = {
        name: _figures(np.median([times[name] for times in rounds], axis=1), len(cells))
        | answers[name]
        for name in made
    }
    return {"rays": len(cells), "bodies": SCAN_BODIES, "engines": figures}, skipped


def drawn_cells(grid: AngularGrid, number: int, seed: int) -> Cells:
    """`number` of the grid's cells, ascending."""
    return np.sort(np.random.default_rng(seed).permutation(grid.size)[:number])


def agreement(
    made: Mapping[str, Caster], bodies: MovingBodies, cells: Cells
) -> dict[str, dict[str, float]]:
    """How far every engine answers as Bullet does, over bodies that have moved."""
    # The second scan is of bodies that have moved. Both warm the engines up for what is timed next.
    answers = {}
    for name, caster in made.items():
        for number in range(2):
            caster.place(bodies.at(number))
            answers[name] = caster.cast(SENSOR, cells)
    ranges, ids = answers[REFERENCE_ENGINE]
    return {
        name: {
            "same_body": float(np.mean(others == ids)),
            "same_range": float(np.mean(np.isclose(found, ranges, rtol=0, atol=SAME_RANGE_M))),
        }
        for name, (found, others) in answers.items()
    }


def laps(
    made: Mapping[str, Caster], bodies: MovingBodies, cells: Cells, samples: int
) -> dict[str, Floats]:
    """(samples, 3) seconds of poses, cast and both, of every engine."""
    # The engines take turns, scan by scan: what else the machine does falls on all alike.
    times = {name: np.empty((samples, 3)) for name in made}
    for number in range(samples):
        poses = bodies.at(number)
        for name, caster in made.items():
            started = time.perf_counter()
            caster.place(poses)
            placed = time.perf_counter()
            caster.cast(SENSOR, cells)
            ended = time.perf_counter()
            times[name][number] = placed - started, ended - placed, ended - started
    return times


def _figures(seconds: Floats, rays: int) -> dict[str, Any]:
    """Figures of an engine from its medians (rounds, 3)."""
    poses, cast, both = (1e3 * seconds.T).tolist()
    return {
        "poses_ms": poses,
        "cast_ms": cast,
        "scan_ms": both,
        "rays_per_s": (rays / seconds[:, 2]).tolist(),
    }
