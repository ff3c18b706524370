"""Measure speed, beside known engines and environments: `make bench`.

All but what takes several threads or processes runs on one core. MuJoCo, panda-gym, Open3D and PPO
are measured where the extra `dev` is installed.
"""

import argparse
import json
import os
import sys
from contextlib import contextmanager, suppress
from dataclasses import asdict, fields
from pathlib import Path

import numpy as np

from care_sim.base.files import write_text
from care_sim.reports.figures.styles import save
from care_sim.study.episode_play import trace
from care_sim.study.provenance import machine, versions
from tests.bench import environments, vectors
from tests.bench.choices import TRACKS, choices
from tests.bench.environments import (
    DRIVE,
    DRIVING,
    EPISODE,
    MAIN,
    REACHING,
    TESTS,
    Settings,
    by_name,
    middle,
)
from tests.bench.scans import REFERENCE, growth, growth_figure, scans
from tests.bench.vectors import PPO, row

BY_THE_CLOCK = "steps/s, "
"""How the names of the ratios begin that depend on how many cores are free."""


def main(arguments=None):
    """Measure, print, write; always 0."""
    parser = argparse.ArgumentParser(prog="make bench", description=__doc__.partition("\n")[0])
    for field in fields(Settings):
        parser.add_argument(f"--{field.name}", type=field.type, default=field.default)
    parser.add_argument("--out", type=Path, help="JSON of all figures; the growth is drawn beside")
    given = vars(parser.parse_args(arguments))
    out = given.pop("out")
    report = bench_report(Settings(**given), lambda what: print("measuring", what, file=sys.stderr))
    for line in lines(report):
        print(line)
    if out:
        write_text(out, json.dumps(report, indent=2) + "\n")
        save(growth_figure(report), out.with_suffix(""))
    return 0


def bench_report(settings, tell=lambda _what: None):
    """All figures of a run: `config`, `machine`, `versions`, `main` (the environment in question),
    the figures of every measure by its name, `ratios`, and `skipped`: what is left out, in one line
    each. `tell` is called with the name of what is measured next.
    """
    made, skipped = environments.makers()
    # An episode that nobody times comes first: no figure holds the time of compiling.
    tell("compiling")
    trace(EPISODE)
    episode = {name: getattr(EPISODE, name) for name in ("scenario", "budget", "policy", "seed")}
    report = {
        "config": episode | asdict(settings),
        "machine": machine(),
        "versions": versions(),
        "main": MAIN,
    }
    # Measurements in several threads or processes need the other cores.
    tell("batches")
    report["batches"] = vectors.batches(settings)
    tell("learning")
    learned, missing = vectors.learning(settings)
    report["batches"] |= learned
    skipped += missing
    tell("vectorised")
    report["vectorised"] = environments.vectorised(settings)
    # All else runs on one, so that libraries with threads of their own gain nothing by them.
    with one_core():
        tell("speed")
        rounds = [
            {name: environments.speed(maker, settings) for name, maker in made.items()}
            for _ in range(settings.repeats)
        ]
        report["speed"] = {name: by_name([told[name] for told in rounds]) for name in made}
        tell("scans")
        report["scans"], missing = scans(settings)
        for measure in (choices, growth):
            tell(measure.__name__)
            report[measure.__name__] = measure(settings)
    return {**report, "ratios": ratios(report), "skipped": skipped + missing}


@contextmanager
def one_core():
    """Keep every thread of this process on one core while this lasts; no effect outside Linux."""
    threads = Path("/proc/self/task")
    if not threads.exists():
        yield
        return

    def bind(cores):
        for thread in threads.iterdir():
            # A thread may end between the listing and the call.
            with suppress(ProcessLookupError):
                os.sched_setaffinity(int(thread.name), cores)

    allowed = os.sched_getaffinity(0)
    bind({max(allowed)})
    try:
        yield
    finally:
        bind(allowed)


def ratios(report):
    """Ratios of medians within this run by name, larger being better: a ratio varies less between
    machines than the times. Figures that were not measured here have no ratio.
    """
    many, more = row(1), row(2)
    # Per second on the core, so that what else runs on it does not favour one side. Two processes
    # or threads are compared by the clock: whether they run at the same time is the question.
    core = {
        f"steps a CPU second over {DRIVING}": (MAIN, DRIVING),
        f"steps a CPU second over {REACHING}": (MAIN, REACHING),
        f"steps a CPU second, {PPO} over {DRIVING}": (PPO, DRIVING),
    }
    for name, peer in [
        (many, MAIN),
        (many, DRIVING),
        (many, REACHING),
        (TESTS, MAIN),
        (DRIVE, MAIN),
    ]:
        core[f"steps a CPU second, {name} over {peer}"] = name, peer
    clock = {f"{BY_THE_CLOCK}{more} over {peer}": (more, peer) for peer in (DRIVING, REACHING)}
    clock[f"{BY_THE_CLOCK}{more} over one thread"] = more, many
    rows = {**report["speed"], **report["batches"]}
    made = {
        name: middle(rows[mine][key]) / middle(rows[peer][key])
        for pairs, key in ((core, "steps_per_cpu_s"), (clock, "steps_per_s"))
        for name, (mine, peer) in pairs.items()
        if {mine, peer} <= set(rows)
    }
    engines = report["scans"]["engines"]
    scan = {name: middle(figures["scan_ms"]) for name, figures in engines.items()}
    for other in scan.keys() - {"fast"}:
        made[f"scan, time of {other} over fast"] = scan[other] / scan["fast"]
    curve = report["growth"]["grid"]["ms"]["fast"]
    made["scan of fast, time on the smallest grid over the largest"] = curve[0] / curve[-1]
    one, two = (middle(values) for values in report["vectorised"].values())
    made[f"{BY_THE_CLOCK}two processes over one"] = two / one
    return made


def lines(report):
    """The lines to print: one per figure, medians with the least and the most."""
    where = report["machine"]
    yield f"{where['processor']}, {where['cores']} cores, {where['system']}"
    yield ", ".join(f"{name} {number}" for name, number in report["versions"].items())
    yield from (f"left out: {line}" for line in report["skipped"])
    units = {
        "steps_per_s": "steps/s",
        "steps_per_cpu_s": "steps per CPU second",
        "inits_per_s": "/s",
    }
    for name, figures in {**report["speed"], **report["batches"]}.items():
        for key, values in figures.items():
            what = "constructions with reset" if key == "inits_per_s" else ""
            yield spread(f"{name} {what}".strip(), units[key], values)
    for number, values in report["vectorised"].items():
        yield spread(f"AsyncVectorEnv of Gymnasium, processes: {number}", "steps/s", values)
    for name, values in report["choices"].items():
        yield spread(f"policy and allocation with {TRACKS} tracks, {name}", "ms", values)
    told = report["scans"]
    for name, figures in told["engines"].items():
        what = f"scan of {name}, {told['rays']} rays, {told['bodies']} bodies"
        yield spread(what, "ms", figures["scan_ms"])
        if name != REFERENCE:
            yield f"  {figures['same_body']:.1%} of its rays meet the same body as in {REFERENCE}"
    yield from (f"{name}: {value:.3g}" for name, value in report["ratios"].items())


def spread(name, unit, values):
    """A figure of several rounds."""
    low, median, high = np.quantile(values, (0.0, 0.5, 1.0))
    return f"{name}: {median:.4g} {unit} ({low:.4g} to {high:.4g})"


if __name__ == "__main__":
    sys.exit(main())
