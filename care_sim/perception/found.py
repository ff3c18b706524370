"""Detections of many worlds."""

from typing import NamedTuple

import numpy as np

from care_sim.core.arrays import Floats, Integers


class Found(NamedTuple):
    """Detections of W worlds: `counts` (W,), `classes` (W, D), and `boxes` (W, D, 7) in the sensor
    frames. `objects` (W, D) are the bodies behind them or NO_OBJECT. `tracks` (W, D) are the ids
    from the track memory. The measured detectors alone write `returns` (W, D) and `scores` (W, D),
    in their own scale.
    """

    counts: Integers
    classes: Integers
    boxes: Floats
    objects: Integers
    tracks: Integers
    returns: Integers
    scores: Floats

    @classmethod
    def of(cls, worlds: int, most: int = 0) -> "Found":
        """Empty tables of up to `most` detections in each world."""
        classes, objects, tracks, returns = np.zeros((4, worlds, most), np.int64)
        boxes, scores = np.zeros((worlds, most, 7)), np.zeros((worlds, most))
        counts = np.zeros(worlds, np.int64)
        return cls(counts, classes, boxes, objects, tracks, returns, scores)

    def with_room(self, most: int) -> "Found":
        """These tables, or empty ones if they are too short for `most` detections."""
        return self if most <= self.classes.shape[1] else Found.of(len(self.counts), most)

    def behind(self, world: int) -> Integers:
        """(n,) the bodies behind the detections of a world."""
        behind: Integers = self.objects[world, : self.counts[world]]
        return behind
