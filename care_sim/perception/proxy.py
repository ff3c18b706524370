"""The paper's proxy detector: an object is detected when enough fired rays hit it.

The proxy is privileged, it reads whose return each one is. A real detector sees points alone and is
made a `care_sim.perception.base.Detector` by `care_sim.perception.points_only.PointsOnly`;
`care_sim.perception.detectors.make_detector` gives either by name.
"""

from collections.abc import Callable, Mapping

import numpy as np

from care_sim.base.checks import check_whole
from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers
from care_sim.core.conditions import MIN_RETURNS
from care_sim.core.types import Detections
from care_sim.sensors.annotated import Annotations, Cloud

_WIDEST = 4096
"""Hits are counted by body id in tables that are no wider."""


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
        """Detections from the body id behind every fired ray, and the detected ids for the scoring.

        `boxes_of` gives the (n, 7) sensor-frame boxes of bodies (n,).
        """
        kept, returns = _hit_often(self._bodies, hits, self._min_returns)
        bodies = self._bodies[kept]
        return Detections(self._labels[kept], boxes_of(bodies), returns), bodies


@compiled()
def _hit_often(bodies: Integers, hits: Integers, least: int) -> tuple[Integers, Integers]:
    """The rows (k,) of those of `bodies` (n,), ascending ids, that are at least so often among the
    `hits`, and how often they are.
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
    """(n,) how often each of `bodies` (n,), ascending ids, is among the `hits`."""
    counts = np.zeros(len(bodies), np.int64)
    if len(bodies) == 0:
        return counts
    first = bodies[0]
    span = bodies[-1] - first + 1
    if span > _WIDEST:
        for hit in hits:
            _count_among(bodies, hit, counts)
        return counts

    # Neighbouring rays mostly hit the same body, and to count it again waits for the count before:
    # so they count in turn in one of four tables. Others count in the last column.
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


class ReturnsProxy:
    """`ReturnsRule` over a film: every annotated object with `min_returns` of the cloud's
    returns on it is detected with its true box. Raises InvalidInput unless `min_returns` is a whole
    number of 1 or more.
    """

    def __init__(self, min_returns: int = MIN_RETURNS):
        check_whole("min_returns", min_returns, 1)
        self._min_returns = min_returns

    def detect(self, cloud: Cloud, annotations: Annotations) -> tuple[Detections, Integers]:
        """See `care_sim.perception.base.Detector`."""
        order = np.argsort(annotations.objects)
        ascending = annotations.objects[order]

        def boxes_of(objects: Integers) -> Floats:
            return annotations.boxes[order[np.searchsorted(ascending, objects)]]

        labels = dict(zip(annotations.objects.tolist(), annotations.classes.tolist(), strict=True))
        return ReturnsRule(labels, self._min_returns).detections(cloud.objects, boxes_of)
