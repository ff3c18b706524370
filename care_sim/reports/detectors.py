"""Tables of detectors on scans."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.types import CLASSES
from care_sim.evaluation.bootstrap import Interval, ratio_of_sums
from care_sim.evaluation.detector_quality import (
    Counts,
    SceneBoxes,
    calibration_error,
    counts,
    score_of_precision,
)
from care_sim.reports.formatting import bounds
from care_sim.reports.table import Bold, Table, TableRow
from care_sim.study.judging import JudgedScene

Judged = Mapping[str, Sequence[JudgedScene]]
"""By detector, scene after scene, the same for all."""
FEWEST_SCENES = 5
"""For an interval: of fewer every other resample is one of a handful."""
_NOTES = (
    "Percent. Right: within 2 m of an object of its class that no surer box has.",
    "* the least score from which it is as precise as all that {} reports.",
)


def detector_tables(judged: Judged, least_scores: Sequence[float], against: str) -> list[Table]:
    """Return tables of every detector's recall and precision, from each of the `least_scores` on.
    Also at the score where a detector is as precise as all reports of the detector `against`; then
    class by class.
    """
    boxes = {name: [scene.boxes for scene in scenes] for name, scenes in judged.items()}
    return [_overall(judged, boxes, least_scores, against), _by_class(boxes, least_scores, against)]


def has_scores(scenes: Sequence[SceneBoxes]) -> bool:
    """Return True if the detector of these boxes has scores: not all are 1."""
    return any((scene.scores != 1).any() for scene in scenes)


def _overall(
    judged: Judged,
    boxes: Mapping[str, Sequence[SceneBoxes]],
    least_scores: Sequence[float],
    against: str,
) -> Table:
    rows: list[TableRow] = []
    theirs = counts(boxes[against]) if against in boxes else None
    for name, scenes in boxes.items():
        scans = sum(scene.scans for scene in scenes)
        time = f"{np.median(np.concatenate([scene.scan_ms for scene in judged[name]])):.1f}"
        if not has_scores(scenes):
            rows.append((name, "-", *_shares(counts(scenes), scans), "-", time, "-", "-"))
            continue
        error = f"{100 * calibration_error(scenes):.1f}"
        for least in least_scores:
            found = counts(scenes, least)
            rows.append((name, f"{least:g}", *_shares(found, scans), error, time, "-", "-"))
        if theirs is None:
            continue
        if name == against:
            rows.append((name, "all", *_shares(theirs, scans), error, time, "-", "-"))
            continue
        alike = score_of_precision(scenes, theirs.precision)
        if alike is None:
            rows.append((name, "none *", *["-"] * 4, error, time, "-", "-"))
            continue
        ours = counts(scenes, alike)
        label = f"{alike:.3f} *"
        rows.append((name, label, *_shares(ours, scans), error, time, *_ahead(ours, theirs)))
    return Table(
        "Detectors",
        (
            "detector", "score from", "first sightings", "recall", "precision", "boxes a scan",
            "calibration error", "ms a scan", f"first sightings minus {against}",
            f"recall minus {against}",
        ),
        tuple(rows),
        (_NOTES[0], _NOTES[1].format(against)),
    )  # fmt: skip


def _by_class(
    boxes: Mapping[str, Sequence[SceneBoxes]], least_scores: Sequence[float], against: str
) -> Table:
    rows: list[TableRow] = []
    for name, scenes in boxes.items():
        for least in least_scores if has_scores(scenes) else [0.0]:
            entries: list[str] = []
            for label in range(len(CLASSES)):
                own = counts([scene.of_class(label) for scene in scenes], least)
                entries += [_percent(own.recall), _percent(own.precision)]
            rows.append((name, f"{least:g}" if least else "-", *entries))
        # At the precision of the other class by class: over all, a class of which one reports much
        # that is wrong would decide.
        if against in boxes and name != against and has_scores(scenes):
            entries = []
            for label in range(len(CLASSES)):
                ours, theirs = (
                    [scene.of_class(label) for scene in each] for each in (scenes, boxes[against])
                )
                alike = score_of_precision(ours, counts(theirs).precision)
                same = None if alike is None else counts(ours, alike)
                entries += [_percent(same.recall), _percent(same.precision)] if same else ["-", "-"]
            rows.append((name, "*", *entries))
    columns = [f"{name}, {what}" for name in CLASSES for what in ("recall", "precision")]
    notes = (_NOTES[0], f"{_NOTES[1].format(against)[:-1]}, class by class.")
    return Table("By class", ("detector", "score from", *columns), tuple(rows), notes, names=2)


def _shares(found: Counts, scans: int) -> Iterator[str]:
    yield from map(_percent, (found.first_recall, found.recall, found.precision))
    yield f"{found.boxes.sum() / scans:.1f}"


def _ahead(ours: Counts, theirs: Counts) -> Iterator[str]:
    """Return how much more is detected, of first sightings and of all."""
    yield _difference(ours.sighted - theirs.sighted, ours.events)
    yield _difference(ours.found - theirs.found, ours.frames)


def _difference(more: Floats, of: Floats) -> str:
    if not of.any():
        return "-"
    if len(of) < FEWEST_SCENES:
        return f"{100 * more.sum() / of.sum():+.1f}"
    each = ratio_of_sums((more, of))
    shown = Interval(*(100 * value for value in each))
    text = f"{shown.mean:+.1f} {bounds(shown, 1)}"
    return Bold(text) if shown.low > 0 or shown.high < 0 else text


def _percent(share: float) -> str:
    return "-" if np.isnan(share) else f"{100 * share:.1f}"
