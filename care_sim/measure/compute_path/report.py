"""The figures of the compute path for several sensors, and their tables beside the paper's."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.measure.bench.choices import TRACKS
from care_sim.measure.bench.run import one_core
from care_sim.measure.compute_path.path import CHOICE, DETECTOR, SCAN, STAGES, compute_path
from care_sim.reports.protocol.formatting import PAPER
from care_sim.reports.protocol.notes import papers
from care_sim.reports.table import Table, TableRow
from care_sim.reports.vehicle import paper
from care_sim.sensors.setups import DEFAULT_SETUP, Sensor, sensor_setup
from care_sim.study.provenance import machine, versions

BUDGET = 0.1
POLICIES = ("care", "care-sbf", "care-sightlines")
"""The paper's two, and the costliest of our own."""
DETECT_EVERY = 10
"""The detector takes most of the time, and runs at every so many keyframes of the first policy."""
WHOLE = "whole path"
CHOICE_BOUND_MS = 5.0
"""p99 of policy and allocation, stated before anything was measured."""
SCAN_BOUND = 20.0
"""Times that a scan of the largest grid may take of one of the default's, likewise."""
_OURS = (
    "Ours holds: the hand-over of finished camera boxes, clustering of the returns of the cells "
    "that fired, tracking, the observation, the policy, Algorithm 1 with its floor. It does not "
    "hold what finds boxes in images (YOLOX in the paper), nor a learned 3D detector. CPU time of "
    "one core, so that what else the machine runs does not count; the paper's budget is of the "
    "wall clock."
)

Figures = dict[str, Any]


def sensors() -> dict[str, Sensor]:
    """The default, the 128 rows that ship, and their data sheet's finest mode."""
    finest = sensor_setup("os1-128")
    return {
        DEFAULT_SETUP: DEFAULT_SETUP,
        "os1-128": "os1-128",
        "os1-128, 2,048 columns": replace(
            finest, grid=replace(finest.grid.heads[0].grid, columns=2048)
        ),
    }


def compute_report(frames: int, tell: Callable[[str], None]) -> Figures:
    """Machine, versions, and by sensor and policy the p50, p99 and maximum of every stage in
    milliseconds over so many keyframes. `tell` is called with the name of what is measured next.
    """
    measured: Figures = {}
    with one_core():
        for name, sensor in sensors().items():
            measured[name] = {}
            for policy in POLICIES:
                tell(f"compute path, {name}, {policy}")
                every = DETECT_EVERY if policy == POLICIES[0] else 0
                spent = compute_path(sensor, policy, BUDGET, frames, 0, every)
                measured[name][policy] = _figures(spent)
    return {"frames": frames, "machine": machine(), "versions": versions(), "sensors": measured}


def _figures(spent: Mapping[str, Floats]) -> dict[str, list[float]]:
    """(p50, p99, maximum) by stage, of the choice, and of the whole where the detector ran."""
    sums = {
        "choice": np.sum([spent[stage] for stage in CHOICE], axis=0),
        WHOLE: np.sum([spent[stage] for stage in STAGES], axis=0),
    }
    return {
        name: np.percentile(ms[np.isfinite(ms)], (50, 99, 100)).tolist()
        for name, ms in {**spent, **sums}.items()
        if np.isfinite(ms).any()
    }


def compute_tables(report: Figures) -> list[Table]:
    """The stages by sensor beside the paper's budget, then the choice of cells by policy."""
    return [_stage_table(report), _choice_table(report)]


def _stage_table(report: Figures) -> Table:
    every = report["sensors"]
    first = [by_policy[POLICIES[0]] for by_policy in every.values()]
    lines: list[TableRow] = [
        (stage, *(_told(figures[stage]) for figures in first)) for stage in (*STAGES, WHOLE)
    ]
    lines.append((f"{SCAN}, outside", *(_told(figures[SCAN]) for figures in first)))
    budget = f"{paper.COMPUTE_P99_MS:g} of {paper.COMPUTE_BUDGET_MS:g} at p99"
    lines.append((f"{PAPER}, its perception path", budget, *("" for _ in first[1:])))
    title = f"Compute path with {TRACKS} tracks, {BUDGET:.0%} of the cells: p50 / p99 / maximum, ms"
    note = (
        f"{report['frames']:,} keyframes; {DETECTOR} and {WHOLE} at every {DETECT_EVERY}th of "
        f"them. {report['machine']['processor']}."
    )
    columns = ("stage", *every)
    return Table(title, columns, tuple(lines), (note, _OURS), papers((paper.COMPUTE,)))


def _choice_table(report: Figures) -> Table:
    every = report["sensors"]
    lines: list[TableRow] = [
        (policy, *(_told(by_policy[policy]["choice"]) for by_policy in every.values()))
        for policy in POLICIES
    ]
    scans = [by_policy[POLICIES[0]][SCAN][0] for by_policy in every.values()]
    lines.append(("scan, times the first", *(f"{scan / scans[0]:.1f}" for scan in scans)))
    return Table(
        f"Policy, allocation and floor with {TRACKS} tracks: p50 / p99 / maximum, ms",
        ("policy", *every),
        tuple(lines),
        (
            f"Targets, on the largest grid: p99 under {CHOICE_BOUND_MS:g} ms, and a scan within "
            f"{SCAN_BOUND:g} times the first.",
        ),
    )


def _told(figures: Sequence[float]) -> str:
    return " / ".join(f"{value:.2f}" if value < 10 else f"{value:.0f}" for value in figures)
