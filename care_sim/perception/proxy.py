"""The proxy detectors, which read the object behind each return.

A real detector reads only points, and `care_sim.perception.points_only.PointsOnly` wraps it.
`care_sim.perception.detectors.make_detector` returns either by name.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from care_sim.base.checks import check_known, check_path, check_whole
from care_sim.base.compiled import compiled
from care_sim.base.errors import InvalidInput, shown
from care_sim.core.arrays import Floats, Integers
from care_sim.core.conditions import MIN_RETURNS
from care_sim.core.types import CLASSES, Detections
from care_sim.perception.points_only import Detector
from care_sim.sensors.annotated import Annotations, Cloud

_WIDEST = 4096
"""Largest width of the tables that count hits by body id."""


class ReturnsRule:
    """Every reported body hit by at least `min_returns` fired rays is detected, with its true box.

    The only part of perception that may see body ids; it upper-bounds a learned detector (paper,
    Sec. 5.6). `labels` maps the ids of reported bodies to classes.
    """

    def __init__(self, labels: Mapping[int, int], min_returns: int = MIN_RETURNS):
        self._bodies = np.array(sorted(labels), np.int64)
        self._labels = np.array([labels[body] for body in sorted(labels)], np.int64)
        self._min_returns = min_returns

    def detections(
        self, hits: Integers, boxes_of: Callable[[Integers], Floats]
    ) -> tuple[Detections, Integers]:
        """Return detections from the body id behind every fired ray, and the detected ids for the
        scoring.

        `boxes_of` returns the (n, 7) sensor-frame boxes of bodies (n,).
        """
        kept, returns = _hit_often(self._bodies, hits, self._min_returns)
        bodies = self._bodies[kept]
        return Detections(self._labels[kept], boxes_of(bodies), returns), bodies


@compiled()
def _hit_often(bodies: Integers, hits: Integers, least: int) -> tuple[Integers, Integers]:
    """Return the rows (k,) of the `bodies` (n,), ascending ids, with at least this many `hits`, and
    their numbers of hits.
    """
    counts = count_hits(bodies, hits)
    kept = np.empty(len(bodies), np.int64)
    count = 0
    for body in range(len(bodies)):
        if counts[body] >= least:
            kept[count], counts[count] = body, counts[body]
            count += 1
    return kept[:count], counts[:count]


@compiled()
def count_hits(bodies: Integers, hits: Integers) -> Integers:
    """Return (n,) the number of `hits` of each of `bodies` (n,), ascending ids."""
    counts = np.zeros(len(bodies), np.int64)
    if len(bodies) == 0:
        return counts
    first = bodies[0]
    span = bodies[-1] - first + 1
    if span > _WIDEST:
        for hit in hits:
            _count_among(bodies, hit, counts)
        return counts

    # Neighbouring rays mostly hit the same body, and each count would wait for the previous one. So
    # rays take turns in four tables. Unlisted bodies count in the last column.
    table = np.zeros((4, span + 1), np.int64)
    for n in range(len(hits)):
        place = hits[n] - first
        table[n & 3, place if 0 <= place < span else span] += 1
    for row in range(len(bodies)):
        for k in range(4):
            counts[row] += table[k, bodies[row] - first]
    return counts


@compiled(brief=True)
def _count_among(bodies: Integers, hit: int, counts: Integers) -> None:
    """Count a hit if it is one of `bodies` (n,), which may lie too far apart for a table."""
    low, high = 0, len(bodies)
    while low < high:
        middle = (low + high) // 2
        low, high = (middle + 1, high) if bodies[middle] < hit else (low, middle)
    if low < len(bodies) and bodies[low] == hit:
        counts[low] += 1


class ReturnsProxy(Detector):
    """The paper's proxy detector: an object is detected when enough fired rays hit it.

    `ReturnsRule` over a film: every annotated object with `min_returns` of the cloud's returns on
    it is detected with its true box. Raises InvalidInput unless `min_returns` is a whole
    number of 1 or more.
    """

    def __init__(self, min_returns: int = MIN_RETURNS):
        check_whole("min_returns", min_returns, 1)
        self._min_returns = min_returns

    def detect(self, cloud: Cloud, annotations: Annotations) -> tuple[Detections, Integers]:
        """See `care_sim.perception.points_only.Detector`."""
        order = np.argsort(annotations.objects)
        ascending = annotations.objects[order]

        def boxes_of(objects: Integers) -> Floats:
            return annotations.boxes[order[np.searchsorted(ascending, objects)]]

        labels = dict(zip(annotations.objects.tolist(), annotations.classes.tolist(), strict=True))
        return ReturnsRule(labels, self._min_returns).detections(cloud.objects, boxes_of)


_VEHICLES = (
    (2, 3, 4, 9, 12, 16, 24, 34, 60, 300),
    (0.0, 0.01, 0.30, 0.30, 0.45, 0.58, 0.78, 0.82, 0.91, 0.98),
)
_PEOPLE = (
    (2, 3, 4, 6, 13, 24),
    (0.0, 0.60, 0.82, 0.89, 0.90, 0.96),
)
"""Numbers of returns, and the share detected; people are on foot or on bicycles. Between two
numbers the share is linear in the logarithm of the number. The dip of cars at about eight returns
is levelled out.
"""
Curves = Mapping[str, tuple[Sequence[float], Sequence[float]]]
"""Per class ascending numbers of returns, and the share detected at each."""
CURVES: Curves = {
    name: _PEOPLE if name in ("bicycle", "pedestrian") else _VEHICLES for name in CLASSES
}


def chance(name: str, returns: Integers, curves: Curves = CURVES) -> Floats:
    """Return (n,) the detection probability of an object of class `name` with `returns` (n,).

    It is 0 below the first number of the curve, and for a class without a curve.
    """
    if name not in curves:
        return np.zeros(len(returns))
    numbers, shares = curves[name]
    # No returns are fewer than one, the least first number.
    known = np.log(np.maximum(returns, 0.5))
    return np.asarray(np.interp(known, np.log(numbers), shares, left=0.0))


def read_curves(file: str | os.PathLike[str]) -> Curves:
    """Read a CSV table with the columns `returns` and `recall`, and `class` unless one curve is for
    all classes. Raises InvalidInput for anything else.
    """
    # Imported here because it loads PyArrow.
    from care_sim.perception.csv_tables import columns_of, read_csv, texts_of

    check_path("file", file)
    path = Path(file)
    table = read_csv(path)
    rows = columns_of(path, table, ("returns", "recall"))
    names = np.array(texts_of(path, table, "class") if "class" in table.column_names else [])
    curves = {}
    for name in dict.fromkeys(names.tolist()) if len(names) else CLASSES:
        check_known(f"class in {path}", name, CLASSES)
        numbers, shares = rows[names == name if len(names) else slice(None)].T
        ascends = len(numbers) and numbers[0] >= 1 and (np.diff(numbers) > 0).all()
        if not (ascends and np.isfinite(numbers).all()):
            raise InvalidInput(
                f"{path}: returns of {name} must ascend from 1 or more, got "
                f"{shown(numbers.tolist())}"
            )
        if not ((shares >= 0) & (shares <= 1)).all():
            raise InvalidInput(
                f"{path}: recall of {name} must lie in [0, 1], got {shown(shares.tolist())}"
            )
        curves[name] = (numbers.tolist(), shares.tolist())
    return curves


class GradedProxy(Detector):
    """A proxy that detects by chance, more probably with more returns, as real detectors do.

    Every object is detected with its true box, by chance: the more returns, the more probably.

    The paper's proxy is a step: an object is always detected from three returns on. A real detector
    begins later and is never certain. `CURVES` are measured on the detector `cluster`: its recall
    of annotated objects within 50 m, by their returns in a full scan. They cover every fourth
    keyframe of the 20 calibration streets (4,500 objects). Vehicles need more returns than people,
    since a part of one is taken for something smaller. A CSV `file` replaces them (`read_curves`).

    The luck of an object depends only on its place from the sensor, in centimetres. It is the same
    for all policies while their cars drive alike, and more returns never lose an object, unless the
    curve falls. Luck is drawn anew at every keyframe if anything moves. A standing object before a
    standing car keeps its luck.
    """

    def __init__(self, file: str | os.PathLike[str] | None = None):
        self._curves = CURVES if file is None else read_curves(file)

    def detect(self, cloud: Cloud, annotations: Annotations) -> tuple[Detections, Integers]:
        """See `care_sim.perception.points_only.Detector`."""
        order = np.argsort(annotations.objects)
        ascending = annotations.objects[order]
        rows = np.searchsorted(ascending, cloud.objects)
        rows = rows[np.isin(cloud.objects, ascending)]
        returns = np.zeros(len(annotations), np.int64)
        returns[order] = np.bincount(rows, minlength=len(annotations))
        chances = np.zeros(len(annotations))
        for number, name in enumerate(CLASSES):
            of_class = annotations.classes == number
            chances[of_class] = chance(name, returns[of_class], self._curves)
        (found,) = np.nonzero(_luck(annotations.boxes) < chances)
        detections = Detections(
            annotations.classes[found], annotations.boxes[found], returns[found]
        )
        return detections, annotations.objects[found]


def _luck(boxes: Floats) -> Floats:
    """Return (n,) uniform numbers from 0 to 1, from the centres of boxes (n, 7) in whole
    centimetres. They are equal on every processor whose arithmetic agrees that far.
    """
    x, y = (np.round(boxes[:, axis] * 100).astype(np.int64).astype(np.uint64) for axis in (0, 1))
    # The finaliser of SplitMix64 (Steele, Lea and Flood 2014), which leaves no trace of its input.
    mixed = x * np.uint64(0x9E3779B97F4A7C15) + y * np.uint64(0xD1B54A32D192ED03)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        mixed = (mixed ^ (mixed >> np.uint64(shift))) * np.uint64(factor)
    mixed ^= mixed >> np.uint64(31)
    return np.asarray((mixed >> np.uint64(11)) / 2.0**53)
