"""`care-sim bench`: measure everything, print it, write it."""

import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from care_sim.base.console import TableConsole
from care_sim.base.files import JSON, replacing
from care_sim.measure.bench.batches import batch_memory, batches
from care_sim.measure.bench.choices import choices
from care_sim.measure.bench.config import BenchConfig
from care_sim.measure.bench.growth import growth, growth_figure
from care_sim.measure.bench.keyframe import stages
from care_sim.measure.bench.learning import learning
from care_sim.measure.bench.ratios import BenchReport, ratios
from care_sim.measure.bench.scanning.scans import scans
from care_sim.measure.bench.steps import makers, speed
from care_sim.measure.bench.tables import bench_tables
from care_sim.measure.bench.targets import targets
from care_sim.measure.bench.workers import study, vectorised, worker_memory
from care_sim.reports.figures.files import check_beside, save
from care_sim.study.provenance import machine, versions

Rounds = dict[str, list[float]]
"""A figure of every round, by name."""

_THREADS = Path("/proc/self/task")


def run_bench(config: BenchConfig) -> int:
    """Measure, print the tables, write JSON and figure; 0 whether or not the targets are met."""
    # Files that cannot be written are refused before anything is measured.
    if config.out is not None:
        check_beside(config.out)
    with nullcontext() if config.out is None else replacing(config.out, JSON) as unfinished:
        report = bench_report(config, partial(print, "measuring", file=sys.stderr))
        console = TableConsole()
        for table in bench_tables(report):
            console.print(table.rich())
        if unfinished is not None:
            unfinished.write_text(json.dumps(report, indent=2) + "\n")
    if config.out is not None:
        save(growth_figure(report), config.out)
    return 0


def bench_report(
    config: BenchConfig, tell: Callable[[str], None] = lambda _what: None
) -> BenchReport:
    """All figures of a run.

    `config`, `machine`, `versions`, `main` (the environment in question), the figures of every
    measure by its name, `ratios`, `targets`, and `skipped`: what is left out, in one line each.
    `tell` is called with the name of what is measured next.
    """
    made, skipped = makers(config)
    # An episode that nobody times comes first: no figure holds the time of compiling.
    tell("compiling")
    stages(config.episode)
    report: BenchReport = {
        "config": {name: value for name, value in asdict(config).items() if name != "out"},
        "machine": machine(),
        "versions": versions(),
        "main": next(iter(made)),
    }
    # What runs in several threads or processes needs the other cores.
    report["batches"] = {}
    for name, rows in (("batches", batches), ("learning", learning)):
        tell(name)
        measured, missing = rows(config)
        report["batches"] |= measured
        skipped += missing
    for name, part in (
        ("memory", worker_memory),
        ("batch_memory", batch_memory),
        ("study", _study),
        ("vectorised", vectorised),
    ):
        tell(name)
        report[name] = part(config)
    # All else runs on one, so that libraries with threads of their own gain nothing by them.
    with one_core():
        tell("speed and stages")
        report["speed"], report["stages"] = _rounds(config, made)
        tell("choices")
        report["choices"] = choices(config)
        tell("scans")
        report["scans"], absent = scans(config)
        tell("growth")
        report["growth"] = growth(config)
    report["ratios"] = ratios(report)
    report["targets"] = [{**asdict(target), "met": target.met} for target in targets(report)]
    return {**report, "skipped": [*skipped, *absent]}


@contextmanager
def one_core() -> Iterator[None]:
    """Keep every thread of this process on one core while this lasts; no effect outside Linux."""
    if not _THREADS.exists():
        yield
        return
    allowed = os.sched_getaffinity(0)
    _bind({max(allowed)})
    try:
        yield
    finally:
        _bind(allowed)


def _bind(cores: set[int]) -> None:
    for thread in _THREADS.iterdir():
        # A thread may end between the listing and the call.
        with suppress(ProcessLookupError):
            os.sched_setaffinity(int(thread.name), cores)


def _study(config: BenchConfig) -> dict[str, float] | None:
    return study(config.seeds) if config.seeds else None


def _rounds(config: BenchConfig, made: dict[str, Any]) -> tuple[dict[str, Rounds], Rounds]:
    """Speed of every environment and the stages of the chosen one, in turn in every round."""
    rounds = [
        ({name: speed(maker, config) for name, maker in made.items()}, stages(config.episode))
        for _ in range(config.repeats)
    ]
    speeds = {name: _by_name([figures[name] for figures, _ in rounds]) for name in made}
    return speeds, _by_name([parts for _, parts in rounds])


def _by_name(rounds: list[dict[str, float]]) -> Rounds:
    return {name: [figures[name] for figures in rounds] for name in rounds[0]}
