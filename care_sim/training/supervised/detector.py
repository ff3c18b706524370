"""Train the learned detector: `care-sim train detector` makes the shipped weights from nothing.

One process plays and another learns from what it plays, so nothing is kept on disk. Plays come in
the order of their numbers, PyTorch computes in one thread, and seeds are fixed: the same machine
makes the same bytes.
"""

import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor
from contextlib import contextmanager
from itertools import count, islice
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from care_sim.base.errors import InvalidInput, print_lines, report_problems
from care_sim.base.extras import import_torch
from care_sim.base.interrupts import FAILED
from care_sim.base.limits import one_thread
from care_sim.base.seeds import TRAINING, VALIDATION
from care_sim.core.arrays import Floats, Mask
from care_sim.core.types import CLASSES, Detections
from care_sim.perception.matching import UNSERVED, served_by
from care_sim.perception.pillars.decoding import Peaks, peaks_of
from care_sim.perception.pillars.detector import (
    CALIBRATION,
    LEAST_SCORE,
    load_detector,
    save_detector,
)
from care_sim.sensors.annotated import Annotations
from care_sim.sources.scenes import Scene
from care_sim.study.executors import Processes, processes
from care_sim.study.provenance import machine_line, package_versions
from care_sim.study.runner import DIED
from care_sim.training.supervised.detector_data import (
    CLUTTERED,
    EITHER,
    Example,
    Targets,
    loss,
    play,
    targets_of,
    turned_example,
)
from care_sim.training.supervised.fit import fit, print_end
from care_sim.training.supervised.options import DetectorConfig
from care_sim.training.supervised.recorded import Scenes
from care_sim.training.supervised.worlds import World

if TYPE_CHECKING:
    from care_sim.training.supervised.detector_network import Learning

PLAIN: Floats = np.tile([1.0, 0.0], (len(CLASSES), 1))
"""The identity calibration."""
LEAST_LOGIT = -6.0
"""Lower peaks are ignored: at most one in four hundred is an object."""
FEWEST_HITS = 20
"""Fewest peaks of a class to fit its scores to."""
NEWTON_STEPS = 30
RIDGE = 1e-3
"""Keeps the fit finite where all peaks above some logit are right."""

BATCH = 4
"""Scans per gradient."""
LEARNING_RATE = 2e-3
"""Highest rate of AdamW."""
WEIGHT_DECAY = 0.01
STEEPEST = 10.0
"""The longest gradient; longer ones are shortened to it."""
SHUFFLED = 512
"""Examples from which a batch is drawn: about twenty plays, so that a batch holds several
streets.
"""
FIRST_BATCHES = 4
"""Examples to normalise layers that continue from weights."""
AHEAD = 4
"""Plays that run ahead."""
RISING = 0.05
"""Share of the steps in which the rate of learning rises."""
CURVE_STEPS = 250
"""Steps between two points of the card's curve; the weights are also written then."""
CALIBRATING = range(VALIDATION, VALIDATION + 24)
HELD_OUT = range(VALIDATION + 24, VALIDATION + 48)
"""Seeds of held-out plays: for fitting scores, and for the card's results."""
LEAST_CHECKED = 8
"""Plays of a source's scenes for each part, repeated if there are fewer scenes: 24."""
CHECKED_CLUTTERED = 8
"""Plays of cluttered streets for each part: each has three times the examples of others."""


def train_pillars(config: DetectorConfig, scenes: Scenes | None = None) -> int:
    """Train the detector, on `scenes` if given, write its weights, and return the exit code of the
    command.
    """
    torch = import_torch()
    from care_sim.training.supervised.detector_network import Learning

    if scenes and config.clutter:
        raise InvalidInput("clutter belongs to generated streets: leave out --source or --clutter")
    started = time.perf_counter()
    torch.manual_seed(config.seed)
    network = Learning()

    def save(
        losses: list[float], calibration: Floats = PLAIN, result: dict[str, float] | None = None
    ) -> None:
        arrays = network.arrays() | {CALIBRATION: calibration.astype(np.float32)}
        save_detector(config.out, arrays, _card(config, scenes, network, losses, result))

    kept = 0

    def keep(losses: list[float]) -> None:
        nonlocal kept
        # The weights learned so far are kept, whatever ends the learning or its check.
        if len(losses) % CURVE_STEPS == 0 or len(losses) == config.steps:
            save(losses)
            kept = len(losses)

    try:
        losses, calibration, result = _learned(config, scenes, network, keep)
    except BaseException as error:
        if kept:
            told = f"{config.out} holds what {kept} steps have taught, not checked"
            print_lines(told, file=sys.stderr)
        if isinstance(error, BrokenExecutor):
            report_problems([f"{DIED} that plays what is learned from"])
            return FAILED
        raise
    save(losses, calibration, result)
    shown = ("--detector", "pillars", "--detector-parameters", f"file={config.out}")
    print_end(config.out, started, result, scenes, "run", "street", *shown)
    return 0


def _learned(
    config: DetectorConfig,
    scenes: Scenes | None,
    network: "Learning",
    keep: Callable[[list[float]], None],
) -> tuple[list[float], Floats, dict[str, float]]:
    """Train the network and check it: losses, calibration, and results on held-out plays."""
    start = None if config.start is None else load_detector(config.start)[0]
    with one_thread(import_torch()), _player() as executor:
        print_lines(f"playing {SHUFFLED} scans before the first step", file=sys.stderr)
        learned = scenes.endless() if scenes else _generated_worlds(config, count(TRAINING))
        batches = _batches(played(executor, learned), np.random.default_rng(config.seed))
        if start is not None:
            network.begin_at(
                start, [one for batch in islice(batches, FIRST_BATCHES) for one in batch]
            )
        losses = train_detector(network, batches, config.steps, keep)
        network.eval()
        print_lines(f"checking {config.out} on plays that are held out", file=sys.stderr)
        checked = (
            _held_out(scenes)
            if scenes
            else [_generated_worlds(config, seeds) for seeds in _checked(config)]
        )
        fitted, apart = (
            [example for examples in executor.map(play, worlds) for example in examples]
            for worlds in checked
        )
        calibration = calibration_of(scores_by_scan(network, fitted))
        result = judged(scores_by_scan(network, apart, calibration))
        return losses, calibration, result


def _generated_worlds(config: DetectorConfig, seeds: Iterable[int]) -> Iterator[World]:
    kind = CLUTTERED if config.clutter else EITHER
    return (World(kind, seed) for seed in seeds)


def _held_out(scenes: Scenes) -> tuple[Sequence[World], Sequence[World]]:
    """Return plays for fitting scores, and plays for the results. A single scene serves both, in
    different plays.
    """
    fitted, apart = scenes.held_out[::2], scenes.held_out[1::2] or scenes.held_out
    return _repeated(scenes, fitted, 0), _repeated(scenes, apart, LEAST_CHECKED)


def _checked(config: DetectorConfig) -> tuple[range, range]:
    """Return the seeds of generated plays for fitting scores, and of those held out."""
    many = CHECKED_CLUTTERED if config.clutter else len(CALIBRATING)
    return CALIBRATING[:many], HELD_OUT[:many]


def _repeated(scenes: Scenes, part: Sequence[Scene], first: int) -> list[World]:
    """Return the worlds of a part, repeated in turns until there are enough."""
    turns = range(first, first - (-LEAST_CHECKED // len(part)))
    return [world for turn in turns for world in scenes.worlds(part, turn)]


def train_detector(
    network: "Learning",
    batches: Iterator[list[Example]],
    steps: int,
    after: Callable[[list[float]], None] = lambda _losses: None,
) -> list[float]:
    """Train the network on this many batches; see `care_sim.training.supervised.fit.fit`."""
    torch = import_torch()
    network.train()
    optimizer = torch.optim.AdamW(network.parameters(), lr=LEARNING_RATE, weight_decay=WEIGHT_DECAY)

    def shorten(*_: object) -> None:
        torch.nn.utils.clip_grad_norm_(network.parameters(), STEEPEST)

    optimizer.register_step_pre_hook(shorten)
    # With so few steps that the rate would rise in at most one, it rises in none: PyTorch divides
    # by the number of rising steps minus one.
    rising = RISING if RISING * steps > 1 else 0.0
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimizer, LEARNING_RATE, total_steps=steps, pct_start=rising, cycle_momentum=False
    )

    def off(batch: list[Example]) -> Any:
        return loss(torch, network(batch), Targets(*map(torch.from_numpy, targets_of(batch))))

    return fit(off, batches, steps, (optimizer, schedule), after)


def played(executor: Executor, worlds: Iterator[World]) -> Iterator[Example]:
    """Yield the examples of the plays of endless `worlds`, in order."""
    under_way = deque(executor.submit(play, one) for one in islice(worlds, AHEAD))
    for world in worlds:
        examples = under_way.popleft().result()
        under_way.append(executor.submit(play, world))
        yield from examples


@contextmanager
def _player() -> Iterator[Executor]:
    """Yield a process that plays. Its remaining work is dropped when learning ends or is
    interrupted.
    """
    executor = processes(1)
    try:
        yield executor
    finally:
        if isinstance(executor, Processes):
            executor.end_at_once()
        executor.shutdown(cancel_futures=True)


def _batches(examples: Iterator[Example], rng: np.random.Generator) -> Iterator[list[Example]]:
    """Yield batches of rotated examples, drawn from a buffer of SHUFFLED that is refilled."""
    waiting = [*islice(examples, SHUFFLED)]
    while True:
        batch = []
        for place in rng.choice(len(waiting), BATCH, replace=False).tolist():
            batch.append(turned_example(waiting[place], rng))
            waiting[place] = next(examples)
        yield batch


def _card(
    made: DetectorConfig,
    scenes: Scenes | None,
    network: "Learning",
    losses: list[float],
    result: dict[str, float] | None,
) -> dict[str, Any]:
    """Return the card of the file; without a `result` the weights are unchecked."""
    numbers = sum(array.size for array in network.arrays().values())
    parts = [losses[n : n + CURVE_STEPS] for n in range(0, len(losses), CURVE_STEPS)]
    told = scenes.told if scenes else _generated(made)
    return {
        "kind": "pillars",
        "network": f"{numbers} numbers",
        "data": f"{len(losses) * BATCH} scans of {told['data']}, of every budget, by the policies "
        "that know any grid; see care_sim.training.supervised.detector_data" + told["terms"],
        "seeds": told["seeds"] | {"training": made.seed},
        "begun at": "drawn weights" if made.start is None else made.start.name,
        "steps": len(losses),
        "steps asked for": made.steps,
        "batch": BATCH,
        "curve": [round(float(np.mean(part)), 3) for part in parts],
        "result": "not checked, scores not calibrated"
        if result is None
        else {name: round(value, 4) for name, value in result.items()},
        "machine": machine_line(),
        "versions": package_versions("care-sim", "numpy", "torch"),
    }


def _generated(made: DetectorConfig) -> dict[str, Any]:
    """Return the part of the card about generated worlds."""
    fitted, apart = _checked(made)
    return {
        "data": "cluttered streets" if made.clutter else "generated streets and drives",
        "terms": "",
        "seeds": {
            "training from": TRAINING,
            "calibration of scores": [fitted[0], fitted[-1]],
            "held out": [apart[0], apart[-1]],
        },
    }


class Judged(NamedTuple):
    """The peaks of a scan. `right` (n,) marks matched ones, `objects` counts objects with a return
    on the plan, `full` is True if every cell fired.
    """

    peaks: Peaks
    right: Mask
    objects: int
    full: bool


def scores_by_scan(
    network: "Learning", examples: list[Example], calibration: Floats = PLAIN
) -> list[Judged]:
    """Return the network's detections in every example."""
    torch = import_torch()
    made = []
    for one in examples:
        with torch.no_grad():
            answer = network([one])[0].numpy()
        peaks = peaks_of(answer, one.sensor_height_m, calibration, 0.0)
        peaks = peaks.take(peaks.logits >= LEAST_LOGIT)
        made.append(Judged(peaks, right(peaks, one), len(one.classes), one.full))
    return made


def right(peaks: Peaks, example: Example) -> Mask:
    """Return (n,) which peaks lie within 2 m of an object of their class that no surer peak
    matches.
    """
    there = Annotations(np.arange(len(example.classes)), example.classes, example.boxes)
    many = np.ones(len(peaks.classes), np.int64)
    server = served_by(there, Detections(peaks.classes, peaks.boxes, many, peaks.scores))
    served = np.zeros(len(peaks.classes), bool)
    served[server[server != UNSERVED]] = True
    return served


def calibration_of(scans: list[Judged]) -> Floats:
    """Return (classes, 2) slope and offset per class that turn a peak's score into its chance to be
    right, by the logistic regression of Platt (1999). A class with too few peaks keeps its logits.
    """
    classes, logits = (
        np.concatenate([column[n] for column in (scan.peaks for scan in scans)]) for n in (0, 1)
    )
    hits = np.concatenate([scan.right for scan in scans])
    made = PLAIN.copy()
    for label in range(len(CLASSES)):
        own = classes == label
        if hits[own].sum() >= FEWEST_HITS and not hits[own].all():
            fitted = _fitted(logits[own], hits[own])
            made[label] = fitted if fitted[0] > 0 else made[label]
    return made


def judged(scans: list[Judged]) -> dict[str, float]:
    """Return recall and precision of all and of full scans at the default score, and the
    calibration error over tenths of scores.
    """
    told: dict[str, float] = {}
    for name, some in (("all scans", scans), ("full scans", [one for one in scans if one.full])):
        sure = [one.peaks.scores >= LEAST_SCORE for one in some]
        hits = sum(int(one.right[rows].sum()) for one, rows in zip(some, sure, strict=True))
        objects, reported = sum(one.objects for one in some), sum(int(rows.sum()) for rows in sure)
        told[f"recall, {name}"] = hits / max(objects, 1)
        told[f"precision, {name}"] = hits / max(reported, 1)
    scores = np.concatenate([one.peaks.scores for one in scans])
    hits_of = np.concatenate([one.right for one in scans])
    tenths = np.minimum((scores * 10).astype(int), 9)
    off = [abs((scores - hits_of)[tenths == n].sum()) for n in range(10)]
    return told | {"calibration error": float(sum(off) / max(len(scores), 1))}


def _fitted(logits: Floats, hits: Mask) -> Floats:
    """Fit slope and offset by Newton's method."""
    design = np.column_stack([logits, np.ones(len(logits))])
    line = np.array([1.0, 0.0])
    for _ in range(NEWTON_STEPS):
        chances = 1 / (1 + np.exp(-np.clip(design @ line, -30, 30)))
        slope = design.T @ (chances - hits) + RIDGE * (line - [1.0, 0.0])
        bend = (design * (chances * (1 - chances))[:, None]).T @ design + RIDGE * np.eye(2)
        line = line - np.linalg.solve(bend, slope)
    return line


if TYPE_CHECKING:
    from care_sim.training.supervised.detector_network import Learning
