"""Speed without a clock: ratios of medians within one run, larger being better.

A ratio varies less between machines than the times. Its name is a key of `results/bench.json`.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from care_sim.measure.bench.batches import ENVPOOL, row
from care_sim.measure.bench.learning import PPO
from care_sim.measure.bench.scanning.scans import REFERENCE_ENGINE
from care_sim.measure.bench.steps import DRIVE, DRIVING, REACHING, TESTS

BenchReport = dict[str, Any]
FAST = "fast"

OVER_DRIVING = f"steps a CPU second over {DRIVING}"
OVER_REACHING = f"steps a CPU second over {REACHING}"
PPO_OVER_DRIVING = f"steps a CPU second, {PPO} over {DRIVING}"
MANY_OVER_DRIVING = f"steps/s, {row(2)} over {DRIVING}"
MANY_OVER_REACHING = f"steps/s, {row(2)} over {REACHING}"
MANY_OVER_ENVPOOL = f"steps/s, {row(2)} over {ENVPOOL}"
TWO_OVER_ONE = "steps/s, two processes over one"
TWO_THREADS_OVER_ONE = f"steps/s, {row(2)} over one thread"
BY_THE_CLOCK = frozenset(
    {
        MANY_OVER_DRIVING,
        MANY_OVER_REACHING,
        MANY_OVER_ENVPOOL,
        TWO_OVER_ONE,
        TWO_THREADS_OVER_ONE,
    }
)
"""Ratios that hang on how many cores are free."""


def over(engine: str, other: str) -> str:
    """Name of the ratio of two engines' scans."""
    return f"scan, time of {other} over {engine}"


def beside(name: str, main: str) -> str:
    """Name of the ratio of two environments' steps."""
    return f"steps a CPU second, {name} over {main}"


def same_on_grid(engine: str) -> str:
    """Name of the ratio of an engine's scans of the same rays on the smallest and the largest
    grid.
    """
    return f"scan of {engine}, time on the smallest grid over the largest"


def ratios(report: BenchReport) -> dict[str, float]:
    """The ratios by name: steps, those of many worlds and those inside PPO over those of known
    environments; those of many worlds, of the drive and of a test of Euro NCAP over those of the
    main environment; scans of `fast` over those of every other engine; and two threads and two
    processes over one. Where there is no engine `fast`, Bullet takes its place.
    """
    engines = report["scans"]["engines"]
    curves = report["growth"]["grid"]["ms"]
    main = report["main"]
    many = row(1), row(2)
    # Per second on the core, so that what else runs on it does not favour one side. Two processes
    # or threads are compared by the clock: whether they run at the same time is the question.
    core, clock = (
        {
            name: middle(figures[key])
            for name, figures in {**report["speed"], **report["batches"]}.items()
        }
        for key in ("steps_per_cpu_s", "steps_per_s")
    )
    scan = {name: middle(figures["scan_ms"]) for name, figures in engines.items()}
    mine = FAST if FAST in engines else REFERENCE_ENGINE
    one, two = (middle(values) for values in report["vectorised"].values())
    by_core = {
        OVER_DRIVING: (main, DRIVING),
        OVER_REACHING: (main, REACHING),
        **{beside(many[0], peer): (many[0], peer) for peer in (main, DRIVING, REACHING)},
        **{beside(name, main): (name, main) for name in (TESTS, DRIVE)},
        PPO_OVER_DRIVING: (PPO, DRIVING),
    }
    by_clock = {
        MANY_OVER_DRIVING: (many[1], DRIVING),
        MANY_OVER_REACHING: (many[1], REACHING),
        MANY_OVER_ENVPOOL: (many[1], ENVPOOL),
        TWO_THREADS_OVER_ONE: many[::-1],
    }
    return {
        **_quotients(by_core, core),
        **_quotients(by_clock, clock),
        **{over(mine, other): scan[other] / scan[mine] for other in scan if other != mine},
        **{
            same_on_grid(engine): curve[0] / curve[-1]
            for engine, curve in curves.items()
            if engine == mine
        },
        TWO_OVER_ONE: two / one,
    }


def _quotients(
    pairs: Mapping[str, tuple[str, ...]], rates: Mapping[str, float]
) -> dict[str, float]:
    """The ratios of pairs of rates; what was not measured here has none."""
    return {
        name: rates[mine] / rates[peer]
        for name, (mine, peer) in pairs.items()
        if {mine, peer} <= set(rates)
    }


def middle(values: Sequence[float]) -> float:
    """The median."""
    return float(np.median(values))
