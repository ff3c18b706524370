"""The targets of speed and memory, held against the figures of a run; for a target that is missed,
what costs most in it.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from care_sim.measure.bench.batches import WORLDS, row
from care_sim.measure.bench.config import BenchConfig
from care_sim.measure.bench.keyframe import WHOLE
from care_sim.measure.bench.learning import PPO
from care_sim.measure.bench.ratios import (
    FAST,
    MANY_OVER_DRIVING,
    MANY_OVER_REACHING,
    TWO_OVER_ONE,
    BenchReport,
    middle,
    over,
    same_on_grid,
)
from care_sim.measure.bench.scanning.scans import REFERENCE_ENGINE
from care_sim.measure.bench.steps import DRIVE

_STEPS_PER_S = 1500.0
_ROW_STEPS_PER_S = {row(2): 10_000.0, row(1): 5500.0, PPO: 2000.0, DRIVE: 300.0}
_WORKER_MB = 250.0
_WORLDS_MB = 500.0
_STUDY_EPISODES = 245
"""Five seeds of the paper's closed-loop study."""
_STUDY_S = 4.0
_CHOICE_MS = 0.5
_FLAT_MB = 5.0
"""A worker may grow by this after the first tenth of its resets: of 2,000, 3 kB each is too
much.
"""
_MANY_BOUNDS = {MANY_OVER_DRIVING: 80.0, MANY_OVER_REACHING: 4.0}
_SCAN_BOUNDS = {
    over(FAST, REFERENCE_ENGINE): 20.0,
    over(FAST, "Embree (Open3D)"): 3.0,
    # Sixteen times the cells may cost a fixed number of rays a quarter more.
    same_on_grid(FAST): 0.8,
}
_TWO_PROCESSES = 1.8
"""Twice the speed of one process, less what two lose to each other, to the pipes and to the process
that steps them."""


@dataclass(frozen=True)
class Target:
    """A figure and its bound, which it must reach, or with `most` not exceed; `holder` is what
    costs most in it, where that was measured.
    """

    name: str
    figure: float
    bound: float
    holder: str = ""
    most: bool = False

    @property
    def met(self) -> bool:
        """Whether the figure is within its bound."""
        return self.figure <= self.bound if self.most else self.figure >= self.bound


def targets(report: BenchReport) -> list[Target]:
    """Every target that this run has figures for; none unless scenario, policy and budget are the
    default ones, of which alone the targets speak.
    """
    if any(
        report["config"][name] != getattr(BenchConfig, name)
        for name in ("scenario", "policy", "budget")
    ):
        return []

    # What costs most in each figure, for whoever wants to mend it.
    keyframe = _keyframe_holder(report)
    scan = _scan_holder(report)
    choice = _choice_holder(report)
    ratios = report["ratios"]
    rows = {**report["batches"], **report["speed"]}
    return [
        Target(
            f"{report['main']}: steps/s",
            middle(report["speed"][report["main"]]["steps_per_s"]),
            _STEPS_PER_S,
            keyframe,
        ),
        *(
            Target(f"{name}: steps/s", middle(rows[name]["steps_per_s"]), bound)
            for name, bound in _ROW_STEPS_PER_S.items()
            if name in rows
        ),
        *(
            Target(name, ratios[name], bound, holder)
            for bounds, holder in ((_MANY_BOUNDS, ""), (_SCAN_BOUNDS, scan))
            for name, bound in bounds.items()
            if name in ratios
        ),
        Target(TWO_OVER_ONE, ratios[TWO_OVER_ONE], _TWO_PROCESSES),
        Target(
            "policy + allocation, p99 in ms",
            middle(report["choices"]["p99"]),
            _CHOICE_MS,
            choice,
            most=True,
        ),
        *_memory_targets("a worker", report["memory"], _WORKER_MB),
        *_memory_targets(f"{WORLDS} worlds", report["batch_memory"], _WORLDS_MB),
        Target(
            f"{WORLDS} worlds, threads left when closed",
            report["batch_memory"]["threads_left"],
            0.0,
            most=True,
        ),
        *_study_target(report["study"]),
    ]


def _memory_targets(name: str, memory: Mapping[str, float], most_mb: float) -> list[Target]:
    gained = memory["peak_mb"] - memory["early_mb"]
    return [
        Target(f"{name}, MB", memory["peak_mb"], most_mb, _memory_holder(memory), most=True),
        Target(f"{name}, MB gained by resets", gained, _FLAT_MB, most=True),
    ]


def _study_target(study: Mapping[str, float] | None) -> list[Target]:
    if study is None:
        return []
    # A run may play another number of seeds than the target speaks of.
    seconds = study["seconds"] / study["episodes"] * _STUDY_EPISODES
    return [
        Target(
            f"the paper's {_STUDY_EPISODES} episodes on 2 cores, s", seconds, _STUDY_S, most=True
        )
    ]


def _longest(parts: Mapping[str, float], whole: float) -> str:
    name = max(parts, key=lambda part: parts[part])
    return f"{name}, {parts[name] / whole:.0%}"


def _keyframe_holder(report: BenchReport) -> str:
    stages = {name: middle(values) for name, values in report["stages"].items()}
    whole = stages.pop(WHOLE)
    return _longest(stages, whole)


def _scan_holder(report: BenchReport) -> str:
    engines = report["scans"]["engines"]
    mine = engines.get(FAST, engines[REFERENCE_ENGINE])
    return _longest(
        {part: middle(mine[f"{part}_ms"]) for part in ("poses", "cast")}, middle(mine["scan_ms"])
    )


def _choice_holder(report: BenchReport) -> str:
    parts = {part: middle(report["choices"][part]) for part in ("demand", "allocation")}
    return _longest(parts, middle(report["choices"]["p50"]))


def _memory_holder(memory: Mapping[str, float]) -> str:
    # Up to the first episode, memory is that of libraries and compiled code.
    begun = memory["begun_mb"]
    return _longest({"libraries": begun, "episodes": memory["peak_mb"] - begun}, memory["peak_mb"])
