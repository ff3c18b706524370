"""The paper's proxy detector: an object is detected when enough fired rays hit it."""

from collections.abc import Callable, Mapping

import numpy as np

from care_sim.conditions import MIN_RETURNS
from care_sim.frames import Floats
from care_sim.types import Detections
from care_sim.world.bullet import Integers


class ReturnsDetector:
    """Detects every reported body hit by at least `min_returns` fired rays, with its true box.

    The only part of perception that may see body ids; it upper-bounds a learned detector (paper,
    Sec. 5.6). `labels` maps the ids of reported bodies to classes.
    """

    def __init__(self, labels: Mapping[int, int], min_returns: int = MIN_RETURNS):
        self._labels = labels
        self._min_returns = min_returns

    def detect(self, hits: Integers, boxes_of: Callable[[Integers], Floats]) -> tuple[Detections, Integers]:
        """Detections from the body id behind every fired ray, and the detected ids for the scoring.

        `boxes_of` gives the (n, 7) sensor-frame boxes of bodies (n,).
        """
        bodies, counts = np.unique(hits, return_counts=True)
        labels = np.array([self._labels.get(body, -1) for body in bodies.tolist()], dtype=np.int64)
        kept = (labels >= 0) & (counts >= self._min_returns)
        return Detections(labels[kept], boxes_of(bodies[kept]), counts[kept]), bodies[kept]
