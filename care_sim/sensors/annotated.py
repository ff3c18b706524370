"""What sensors measure of a scene that somebody annotated, with the object behind each return and
each box.

The objects are truth: for the scoring and privileged policies.
"""

from dataclasses import dataclass

import numpy as np

from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.grid import Cells
from care_sim.core.types import ImageDetections

NO_OBJECT = -1
"""The object behind a return or a camera box that lies on no annotated object."""


@dataclass(frozen=True)
class Annotations:
    """The annotated objects of a keyframe: `objects` (n,) numbers that hold for the whole film,
    `classes` (n,) into `care_sim.core.types.CLASSES`, `boxes` (n, 7) in the sensor frame. All
    ranges; the scoring chooses.
    """

    objects: Integers
    classes: Integers
    boxes: Floats

    def __len__(self) -> int:
        return len(self.objects)


NO_ANNOTATIONS = Annotations(np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, 7)))


@dataclass(frozen=True)
class Cloud:
    """Returns: `cells` (P,) ascending (several returns of a recorded sweep may share one), `points`
    (P, 3) in the sensor frame, `objects` (P,) the annotated object that each lies on or NO_OBJECT,
    `times` (P,), seconds from the keyframe, where they have their own.
    """

    cells: Cells
    points: Floats
    objects: Integers
    times: Floats | None = None

    def __len__(self) -> int:
        return len(self.cells)

    def take(self, kept: Mask) -> "Cloud":
        """Some of the returns, by mask (P,)."""
        rows = np.flatnonzero(kept)
        return Cloud(
            self.cells[rows],
            self.points.take(rows, axis=0),
            self.objects[rows],
            None if self.times is None else self.times[rows],
        )


@dataclass(frozen=True)
class IdentifiedDetections:
    """Camera detections, with `objects` (n,) the annotated object or the body behind each box, or
    NO_OBJECT. `visible` (n,) is the share of each object that its picture shows, where the source
    annotates it; else boxes are those of what is visible.
    """

    detections: ImageDetections
    objects: Integers
    visible: Floats | None = None

    def __len__(self) -> int:
        return len(self.objects)
