"""All figures of a run."""

from dataclasses import asdict
from typing import Any

from care_sim.bench.choices import choices
from care_sim.bench.config import BenchConfig
from care_sim.bench.core import one_core
from care_sim.bench.growth import growth
from care_sim.bench.keyframe import stages
from care_sim.bench.memory import worker_memory
from care_sim.bench.ratios import Report, ratios
from care_sim.bench.scans import scans
from care_sim.bench.steps import makers, speed
from care_sim.bench.targets import targets
from care_sim.bench.vector import vectorised
from care_sim.study.provenance import machine, versions

Rounds = dict[str, list[float]]


def measure(config: BenchConfig) -> Report:
    """`config`, `machine`, `versions`, `main` (the environment in question), every measure by the name of its file's
    figures, `ratios`, `targets`, and `skipped`, what is left out in one line each.
    """
    made, skipped = makers(config)
    report: Report = {
        "config": {name: value for name, value in asdict(config).items() if name != "out"},
        "machine": machine(),
        "versions": versions(),
        "main": next(iter(made)),
        "memory": worker_memory(config),
        "vectorised": vectorised(config),
    }
    with one_core():
        report["speed"], report["stages"] = _rounds(config, made)
        report["choices"] = choices(config)
        report["scans"], absent = scans(config)
        report["growth"] = growth(config)
    report["ratios"] = ratios(report)
    report["targets"] = [{**asdict(target), "met": target.met} for target in targets(report)]
    return {**report, "skipped": [*skipped, *absent]}


def _rounds(config: BenchConfig, made: dict[str, Any]) -> tuple[dict[str, Rounds], Rounds]:
    """Speed of every environment and the stages of the chosen one, in turn in every round; the first stages warm up."""
    stages(config.episode)
    rounds = [
        ({name: speed(maker, config) for name, maker in made.items()}, stages(config.episode))
        for _ in range(config.repeats)
    ]
    speeds = {name: _columns([figures[name] for figures, _ in rounds]) for name in made}
    return speeds, _columns([parts for _, parts in rounds])


def _columns(rounds: list[dict[str, float]]) -> Rounds:
    return {name: [figures[name] for figures in rounds] for name in rounds[0]}
