"""Speed without a clock: ratios of medians within one run, larger being better.

A ratio varies less between machines than the times. Its name is a key of `results/bench.json`.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from care_sim.measure.bench.scanning.scans import REFERENCE_ENGINE
from care_sim.measure.bench.steps import DRIVE, DRIVING, REACHING, TESTS

BenchReport = dict[str, Any]
FAST = "fast"

OVER_DRIVING = f"steps a CPU second over {DRIVING}"
OVER_REACHING = f"steps a CPU second over {REACHING}"
TWO_OVER_ONE = "steps/s, two processes over one"


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
    """The ratios by name: steps over those of known environments, those of the drive and of a test
    of Euro NCAP over those of the main environment, scans of `fast` over those of
    every other engine, and two processes over one. Where there is no engine `fast`, Bullet takes
    its place.
    """
    speed = report["speed"]
    engines = report["scans"]["engines"]
    curves = report["growth"]["grid"]["ms"]
    # Per second on the core, so that what else runs on it does not favour one side. Two processes
    # are compared by the clock: whether they run at the same time is the question.
    steps = {name: middle(figures["steps_per_cpu_s"]) for name, figures in speed.items()}
    scan = {name: middle(figures["scan_ms"]) for name, figures in engines.items()}
    mine = FAST if FAST in engines else REFERENCE_ENGINE
    one, two = (middle(values) for values in report["vectorised"].values())
    # What was not measured here has no ratio.
    return {
        **{
            name: steps[report["main"]] / steps[peer]
            for name, peer in ((OVER_DRIVING, DRIVING), (OVER_REACHING, REACHING))
            if peer in steps
        },
        **{
            beside(name, report["main"]): steps[name] / steps[report["main"]]
            for name in (TESTS, DRIVE)
            if name in steps
        },
        **{over(mine, other): scan[other] / scan[mine] for other in scan if other != mine},
        **{
            same_on_grid(engine): curve[0] / curve[-1]
            for engine, curve in curves.items()
            if engine == mine
        },
        TWO_OVER_ONE: two / one,
    }


def middle(values: Sequence[float]) -> float:
    """The median."""
    return float(np.median(values))
