"""All figures of a run."""

from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from care_sim.measure.bench.choices import choices
from care_sim.measure.bench.config import BenchConfig
from care_sim.measure.bench.core import one_core
from care_sim.measure.bench.growth import growth
from care_sim.measure.bench.keyframe import stages
from care_sim.measure.bench.memory import worker_memory
from care_sim.measure.bench.ratios import BenchReport, ratios
from care_sim.measure.bench.scanning.scans import scans
from care_sim.measure.bench.steps import makers, speed
from care_sim.measure.bench.study import study
from care_sim.measure.bench.targets import targets
from care_sim.measure.bench.vector import vectorised
from care_sim.study.provenance import machine, versions

Rounds = dict[str, list[float]]


def measure(config: BenchConfig, tell: Callable[[str], None] = lambda _what: None) -> BenchReport:
    """`config`, `machine`, `versions`, `main` (the environment in question), every measure by the
    name of its file's figures, `ratios`, `targets`, and `skipped`, what is left out in one line
    each.

    `tell` hears what is measured next. An episode that nobody times comes first: what it compiles
    costs no figure.
    """
    made, skipped = makers(config)
    tell("compiling")
    stages(config.episode)
    report: BenchReport = {
        "config": {name: value for name, value in asdict(config).items() if name != "out"},
        "machine": machine(),
        "versions": versions(),
        "main": next(iter(made)),
    }
    for name, part in (("memory", worker_memory), ("study", _study), ("vectorised", vectorised)):
        tell(name)
        report[name] = part(config)
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


def _study(config: BenchConfig) -> dict[str, float] | None:
    return study(config.seeds) if config.seeds else None


def _rounds(config: BenchConfig, made: dict[str, Any]) -> tuple[dict[str, Rounds], Rounds]:
    """Speed of every environment and the stages of the chosen one, in turn in every round."""
    rounds = [
        ({name: speed(maker, config) for name, maker in made.items()}, stages(config.episode))
        for _ in range(config.repeats)
    ]
    speeds = {name: _columns([figures[name] for figures, _ in rounds]) for name in made}
    return speeds, _columns([parts for _, parts in rounds])


def _columns(rounds: list[dict[str, float]]) -> Rounds:
    return {name: [figures[name] for figures in rounds] for name in rounds[0]}
