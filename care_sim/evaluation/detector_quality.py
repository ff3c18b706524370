"""Quality of a detector's boxes: precision and recall by least score.

A box is right if it is matched to an object by the scoring's rule (`care_sim.perception.matching`).
Detections choose objects in descending order of score. So boxes below a score take no object from
those above it, and one play covers every least score.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.cells.boxes import planar_ranges
from care_sim.core.types import Detections
from care_sim.evaluation.sightings import RANGE_M, Sightings
from care_sim.perception.matching import UNSERVED, served_by

UNFOUND = -np.inf
"""Score of an object without a box."""
TENTHS = 10


@dataclass(frozen=True)
class SceneBoxes:
    """The boxes of a detector in a scene.

    Boxes within range: `scores` (d,), 1 for a detector without scores, `classes` (d,), and whether
    they are `right` (d,). Object frames within range: `found_at` (r,), the score of the matched box
    or UNFOUND, and `labels` (r,). `events` (e,) are the rows of first sightings. `scans` is the
    number of keyframes.
    """

    scores: Floats
    classes: Integers
    right: Mask
    found_at: Floats
    labels: Integers
    events: Integers
    scans: int

    def of_class(self, label: int) -> "SceneBoxes":
        """Return the boxes and objects of one class."""
        own, rows = self.classes == label, self.labels == label
        events = np.zeros(len(rows), bool)
        events[self.events] = True
        return SceneBoxes(
            self.scores[own],
            self.classes[own],
            self.right[own],
            self.found_at[rows],
            self.labels[rows],
            np.flatnonzero(events[rows]),
            self.scans,
        )


@dataclass(frozen=True)
class Counts:
    """Sums per scene (s,) of boxes from a least score on. `right` of the `boxes`, `found` of the
    object `frames`, `sighted` of the `events`.
    """

    boxes: Floats
    right: Floats
    frames: Floats
    found: Floats
    events: Floats
    sighted: Floats

    @property
    def precision(self) -> float:
        """Share of the boxes that are right; nan without a box."""
        return _share(self.right, self.boxes)

    @property
    def recall(self) -> float:
        """Share of the object frames that are found."""
        return _share(self.found, self.frames)

    @property
    def first_recall(self) -> float:
        """Share of the first sightings that are detected at once."""
        return _share(self.sighted, self.events)


def scene_boxes(sightings: Sightings, reports: Sequence[Detections]) -> SceneBoxes:
    """Return the boxes of a scene from the detections of its keyframes, in order."""
    scores, classes, right, found_at = [], [], [], []
    for shown, report in zip(sightings.keyframes, reports, strict=True):
        sure = np.ones(len(report)) if report.scores is None else report.scores
        server = served_by(shown, report)
        serves = np.zeros(len(report), bool)
        serves[server[server != UNSERVED]] = True
        # A box beyond the scored range may be right, but its object is not scored.
        near = planar_ranges(report.boxes) <= RANGE_M
        scores.append(sure[near])
        classes.append(report.classes[near])
        right.append(serves[near])
        found = np.full(len(shown), UNFOUND)
        found[server != UNSERVED] = sure[server[server != UNSERVED]]
        found_at.append(found)
    return SceneBoxes(
        np.concatenate(scores),
        np.concatenate(classes),
        np.concatenate(right),
        np.concatenate(found_at)[sightings.in_range],
        sightings.frames.classes,
        sightings.events,
        len(reports),
    )


def counts(scenes: Sequence[SceneBoxes], score: float = 0.0) -> Counts:
    """Return the sums of boxes with this score or more."""
    rows = [
        (
            np.sum(one.scores >= score),
            np.sum(one.right[one.scores >= score]),
            len(one.found_at),
            np.sum(one.found_at >= score),
            len(one.events),
            np.sum(one.found_at[one.events] >= score),
        )
        for one in scenes
    ]
    return Counts(*np.array(rows, float).reshape(-1, 6).T)


def score_of_precision(scenes: Sequence[SceneBoxes], precision: float) -> float | None:
    """Return the least score from which on at least this share of all boxes is right; None without
    one.
    """
    scores, shares = _by_least_score(scenes)
    enough = np.flatnonzero(shares >= precision)
    return float(scores[enough[-1]]) if len(enough) else None


def curve(scenes: Sequence[SceneBoxes], points: int = 200) -> Floats:
    """Return (n, 3) score, recall and precision from each of up to this many least scores, the
    highest first.
    """
    scores, shares = _by_least_score(scenes)
    rows = np.unique(np.linspace(0, max(len(scores) - 1, 0), min(points, len(scores))).astype(int))
    found = np.sort(np.concatenate([one.found_at for one in scenes]))
    missed = np.searchsorted(found, scores[rows])
    recall = 1 - missed / len(found) if len(found) else np.full(len(rows), np.nan)
    return np.stack([scores[rows], recall, shares[rows]], axis=1)


def reliability(scenes: Sequence[SceneBoxes]) -> Floats:
    """Return (TENTHS, 3) for each tenth of scores: number of boxes, mean score, share of right
    boxes; nan without a box.
    """
    scores = np.concatenate([one.scores for one in scenes])
    right = np.concatenate([one.right for one in scenes])
    tenths = np.minimum((scores * TENTHS).astype(int), TENTHS - 1)
    many, sure, hits = (
        np.bincount(tenths, weights, TENTHS) for weights in (None, scores, right.astype(float))
    )
    with np.errstate(invalid="ignore"):
        return np.stack([many, sure / many, hits / many], axis=1).astype(float)


def calibration_error(scenes: Sequence[SceneBoxes]) -> float:
    """Return the calibration error: the distance of a tenth's mean score from its share of right
    boxes, averaged over boxes (Guo et al. 2017, Eq. 3).
    """
    many, sure, hits = reliability(scenes).T
    return _share(np.nan_to_num(many * np.abs(sure - hits)), many)


def _by_least_score(scenes: Sequence[SceneBoxes]) -> tuple[Floats, Floats]:
    """Return every score of a box, descending, and the share of right boxes from it on."""
    scores = np.concatenate([one.scores for one in scenes])
    order = np.argsort(-scores)
    hits = np.cumsum(np.concatenate([one.right for one in scenes])[order])
    # The last row of equal scores covers all of them.
    last = np.flatnonzero(np.diff(scores[order], append=-np.inf))
    return scores[order][last], hits[last] / (last + 1)


def _share(part: Floats, whole: Floats) -> float:
    return float(part.sum() / whole.sum()) if whole.sum() else float("nan")
