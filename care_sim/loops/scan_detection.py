"""What the closed loop detects in a scan of its world, and whom it so finds."""

from collections.abc import Callable, Mapping

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.cells.stack import Grid
from care_sim.core.types import Detections, Scan
from care_sim.perception.matching import found_objects
from care_sim.perception.points_only import Detector
from care_sim.perception.proxy import ReturnsRule
from care_sim.sensors.annotated import NO_OBJECT, Annotations, cloud_of


class ScanDetection:
    """The detector of an episode. Without one the paper's proxy detects what enough fired rays hit.

    `labels` maps the ids of reported bodies to classes.
    """

    def __init__(
        self,
        grid: Grid,
        labels: Mapping[int, int],
        min_returns: int,
        detector: Detector | None,
    ):
        self._grid = grid
        self._reported = np.array(list(labels), np.int64)
        self._classes = np.array(list(labels.values()), np.int64)
        self._returns_rule = ReturnsRule(labels, min_returns)
        self._detector = detector

    def detect(
        self, scan: Scan, bodies: Integers, boxes_of: Callable[[Integers], Floats]
    ) -> tuple[Detections, Integers, Integers]:
        """The detections, the body behind each or NO_OBJECT, and all bodies that were found.

        `bodies` are those behind the returns; `boxes_of` gives the (n, 7) sensor-frame boxes of
        bodies (n,). The proxy alone may ask whose return each is. What another detector finds is
        scored by the class-consistent 2 m match (paper, Remark 1), and only what a box has returns
        of: else a box on the end of a lorry would find who is hidden behind it.
        """
        if self._detector is None:
            detections, detected = self._returns_rule.detections(bodies, boxes_of)
            return detections, detected, detected
        objects = np.where(np.isin(bodies, self._reported), bodies, NO_OBJECT)
        cloud = cloud_of(scan, objects, self._grid)
        present = Annotations(self._reported, self._classes, boxes_of(self._reported))
        detections, behind = self._detector.detect(cloud, present)
        hit = np.isin(present.objects, behind)
        candidates = Annotations(present.objects[hit], present.classes[hit], present.boxes[hit])
        found = found_objects(candidates, detections)
        return detections, behind, candidates.objects[found]
