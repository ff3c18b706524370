"""The figures of a run for people."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from care_sim.measure.bench.batches import ENVPOOL, ENVPOOL_CONTAINS, WORLDS
from care_sim.measure.bench.choices import TRACKS
from care_sim.measure.bench.keyframe import REST
from care_sim.measure.bench.learning import PPO
from care_sim.measure.bench.ratios import BenchReport
from care_sim.reports.table import Table

_SPREAD = "median (least to most)"


def bench_tables(report: BenchReport) -> list[Table]:
    """Speed with the machine, many worlds, vectors, the keyframe, choices, scans, memory, ratios,
    targets.
    """
    return [
        _speed(report),
        _batches(report),
        _spreads(
            "Steps/s of Gymnasium's AsyncVectorEnv, policies inside",
            "processes",
            report["vectorised"],
        ),
        _stages(report["stages"]),
        _spreads(f"Policy and allocation with {TRACKS} tracks, ms", "figure", report["choices"]),
        _scans(report),
        _memory(report),
        Table(
            "Ratios within this run",
            ("ratio", ""),
            tuple((k, _plain(v)) for k, v in report["ratios"].items()),
        ),
        *([_targets(report)] if report["targets"] else []),
    ]


def _speed(report: BenchReport) -> Table:
    rows = tuple(
        (
            name,
            *(_spread(figures[key]) for key in ("steps_per_s", "steps_per_cpu_s", "inits_per_s")),
        )
        for name, figures in report["speed"].items()
    )
    where = report["machine"]
    notes = (
        f"{where['processor']}, one of {where['cores']} cores, {where['system']}",
        ", ".join(f"{name} {number}" for name, number in report["versions"].items()),
        *(f"left out: {line}" for line in report["skipped"]),
    )
    title = f"Speed: {_SPREAD} of {report['config']['repeats']}"
    return Table(
        title,
        ("environment", "steps/s, resets included", "per CPU second", "constructions with reset/s"),
        rows,
        notes,
    )


def _batches(report: BenchReport) -> Table:
    rows = tuple(
        (name, *(_spread(figures[key]) for key in ("steps_per_s", "steps_per_cpu_s")))
        for name, figures in report["batches"].items()
    )
    config = report["config"]
    notes = [
        f"worlds of {report['main']} at {config['budget']:.0%}, with {config['policy']} inside for "
        "all of them, copy=False; observations are handed out at every step; resets included",
        "scoring_info=False: infos without what is for scoring alone, and rewards the same",
        "two processes: half of the worlds in each, with a vector and a policy of its own",
    ]
    if PPO in report["batches"]:
        notes.append(
            "PPO: by the recipe of the shipped weights, the updates included; answered at once, it "
            "waits for no environment"
        )
    if ENVPOOL in report["batches"]:
        notes.append(ENVPOOL_CONTAINS)
    return Table(
        f"Many worlds at once: {_SPREAD} of {config['repeats']}",
        ("worlds", "steps/s of all together", "per CPU second of any thread"),
        rows,
        tuple(notes),
    )


def _stages(stages: Mapping[str, Sequence[float]]) -> Table:
    note = (
        f"{REST}, an estimate: what lies between these stages: drawing the floor, "
        "the cells of an action, frames, records, info"
    )
    return replace(_spreads("Where a keyframe's time goes, ms", "stage", stages), notes=(note,))


def _scans(report: BenchReport) -> Table:
    scans = report["scans"]
    rows = tuple(
        (
            name,
            *(f"{np.median(figures[key]):.3f}" for key in ("poses_ms", "cast_ms")),
            _spread(figures["scan_ms"]),
            f"{np.median(figures['rays_per_s']) / 1e6:.2f}",
            f"{figures['same_body']:.1%}, {figures['same_range']:.1%}",
        )
        for name, figures in scans["engines"].items()
    )
    columns = ("engine", "poses", "cast", f"both, {_SPREAD}", "million rays/s", "same")
    notes = (
        "same: shares of the rays that meet the same body as Bullet's, and that end within 1 mm of "
        "them",
        "Bullet and Embree take in moved bodies when they cast, so that much of the time for their "
        "poses counts there",
    )
    return Table(
        f"A scan of {scans['rays']} rays at {scans['bodies']} moving bodies, ms",
        columns,
        rows,
        notes,
    )


def _memory(report: BenchReport) -> Table:
    moments = {
        "the first resets and a step": "begun_mb",
        "a tenth of the resets": "early_mb",
        "all resets": "peak_mb",
    }
    holders = {
        f"a worker, {report['memory']['resets']:.0f} resets": report["memory"],
        f"{WORLDS} worlds, {report['batch_memory']['resets']:.0f} resets": report["batch_memory"],
    }
    rows = tuple(
        (f"after {moment}", *(f"{memory[key]:.0f}" for memory in holders.values()))
        for moment, key in moments.items()
    )
    note = "libraries and compiled code included"
    return Table("Peak memory of a process, MB", ("", *holders), rows, (note,))


def _targets(report: BenchReport) -> Table:
    rows = tuple(
        (
            target["name"],
            _plain(target["figure"]),
            f"{'at most' if target['most'] else 'at least'} {target['bound']:g}",
            "met"
            if target["met"]
            else f"not met; most of it: {target['holder']}"
            if target["holder"]
            else "not met",
        )
        for target in report["targets"]
    )
    return Table("Targets", ("target", "here", "bound", ""), rows)


def _spreads(title: str, column: str, figures: Mapping[str, Sequence[float]]) -> Table:
    return Table(
        title, (column, _SPREAD), tuple((name, _spread(values)) for name, values in figures.items())
    )


def _spread(values: Sequence[float]) -> str:
    low, middle, high = np.quantile(values, (0.0, 0.5, 1.0)).tolist()
    # Three significant digits or so, since medians run from microseconds to thousands of steps.
    digits = 1 if middle >= 10 else 3 if middle < 1 else 2
    return f"{middle:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


def _plain(value: float) -> str:
    return f"{value:.3g}" if value < 100 else f"{value:.0f}"
