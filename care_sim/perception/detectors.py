"""The paper's proxy detector: an object is detected when enough fired rays hit it."""

from collections.abc import Callable, Mapping

import numpy as np

from care_sim.frames import Floats
from care_sim.types import Detections
from care_sim.world.bullet import Integers

MIN_RETURNS = 3
"""Fired rays that must hit an object. The fewest that span a surface."""


class ReturnsDetector:
    """Detects every reported body hit by at least `min_returns` fired rays, with its true box.

    The only part of perception that may see body ids; it upper-bounds a learned detector (paper,
    Sec. 5.6). `labels` maps the ids of reported bodies to classes.
    """

    def __init__(self, labels: Mapping[int, int], min_returns: int = MIN_RETURNS):
        self._labels = labels
        self._min_returns = min_returns

    def detect(self, hits: Integers, box_of: Callable[[int], Floats]) -> tuple[Detections, Integers]:
        """Detections from the body id behind every fired ray, and the detected ids for the scoring.

        `box_of` gives the (7,) sensor-frame box of a body.
        """
        bodies, counts = np.unique(hits, return_counts=True)
        kept = [
            (body, count)
            for body, count in zip(bodies.tolist(), counts.tolist(), strict=True)
            if count >= self._min_returns and body in self._labels
        ]
        detections = Detections(
            np.array([self._labels[body] for body, _ in kept], dtype=np.int64),
            np.array([box_of(body) for body, _ in kept]).reshape(-1, 7),
            np.array([count for _, count in kept], dtype=np.int64),
        )
        return detections, np.array([body for body, _ in kept], dtype=np.int64)
