"""How sure the learned detector may be and what it finds, on plays that nothing is learned from."""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from care_sim.core.arrays import Floats, Mask
from care_sim.core.types import CLASSES, Detections
from care_sim.perception.matching import UNSERVED, served_by
from care_sim.perception.pillars.decoding import Peaks, peaks_of
from care_sim.perception.pillars.detector import LEAST_SCORE
from care_sim.sensors.annotated import Annotations
from care_sim.training.detector_data import Example

if TYPE_CHECKING:
    from care_sim.training.detector_network import Learning

PLAIN: Floats = np.tile([1.0, 0.0], (len(CLASSES), 1))
"""The calibration that leaves every logit as it is."""
LEAST_LOGIT = -6.0
"""Peaks below are not looked at: an object in four hundred, or fewer."""
FEWEST_HITS = 20
"""Of a class, to fit its scores to."""
NEWTON_STEPS = 30
RIDGE = 1e-3
"""Keeps the fit finite where all peaks above some logit are right."""


class Judged(NamedTuple):
    """The peaks of a scan, `right` (n,) those that serve an object, and how many `objects` with
    a return stood on the plan; `full` says that every cell fired.
    """

    peaks: Peaks
    right: Mask
    objects: int
    full: bool


def scores_by_scan(
    torch: Any, network: "Learning", examples: list[Example], calibration: Floats = PLAIN
) -> list[Judged]:
    """What the network makes of every example."""
    made = []
    for one in examples:
        with torch.no_grad():
            answer = network([one])[0].numpy()
        peaks = peaks_of(answer, one.sensor_height_m, calibration, 0.0)
        peaks = peaks.take(peaks.logits >= LEAST_LOGIT)
        made.append(Judged(peaks, right(peaks, one), len(one.classes), one.full))
    return made


def right(peaks: Peaks, example: Example) -> Mask:
    """(n,) which peaks lie within 2 m of an object of their class that no surer one serves."""
    there = Annotations(np.arange(len(example.classes)), example.classes, example.boxes)
    many = np.ones(len(peaks.classes), np.int64)
    server = served_by(there, Detections(peaks.classes, peaks.boxes, many, peaks.scores))
    served = np.zeros(len(peaks.classes), bool)
    served[server[server != UNSERVED]] = True
    return served


def calibration_of(scans: list[Judged]) -> Floats:
    """(classes, 2) slope and offset, by class, that make the score of a peak its chance to be
    right: the logistic regression of Platt (1999). A class with too few keeps its logits.
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
    """Recall and precision of all and of full scans at the score that is reported by default, and
    the mean distance of scores from the share that is right, over tenths.
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
    """Slope and offset by Newton's method."""
    design = np.column_stack([logits, np.ones(len(logits))])
    line = np.array([1.0, 0.0])
    for _ in range(NEWTON_STEPS):
        chances = 1 / (1 + np.exp(-np.clip(design @ line, -30, 30)))
        slope = design.T @ (chances - hits) + RIDGE * (line - [1.0, 0.0])
        bend = (design * (chances * (1 - chances))[:, None]).T @ design + RIDGE * np.eye(2)
        line = line - np.linalg.solve(bend, slope)
    return line
