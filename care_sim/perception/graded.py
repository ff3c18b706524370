"""A proxy that is the surer the more rays hit an object, as a real detector is.

The paper's proxy is a step: an object is detected from three returns on, always. A real detector
begins later and is never certain. The curves here are those of the detector `cluster`: the share of
annotated objects within 50 m that it finds, by how many returns of the full scan lie on them, over
every fourth keyframe of the 20 calibration streets (4,500 objects). Vehicles need more returns than
people, since a part of one is taken for something smaller.
"""

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.types import CLASSES, Detections
from care_sim.sensors.annotated import Annotations, Cloud

_VEHICLES = (
    (2, 3, 4, 9, 12, 16, 24, 34, 60, 300),
    (0.0, 0.01, 0.30, 0.30, 0.45, 0.58, 0.78, 0.82, 0.91, 0.98),
)
_PEOPLE = (
    (2, 3, 4, 6, 13, 24),
    (0.0, 0.60, 0.82, 0.89, 0.90, 0.96),
)
"""Numbers of returns, and the share that is found; people are those on foot and on bicycles.
Between two numbers the share grows with the logarithm of the number. The dip that cars have about
eight returns is levelled out."""
CURVES = {name: _PEOPLE if name in ("bicycle", "pedestrian") else _VEHICLES for name in CLASSES}


def chance(name: str, returns: Integers) -> Floats:
    """(n,) how probably an object of the class `name` is detected with `returns` (n,) on it."""
    numbers, shares = CURVES[name]
    known = np.log(np.maximum(returns, 1))
    return np.asarray(np.interp(known, np.log(numbers), shares))


class GradedProxy:
    """Every object is detected with its true box, by chance: the more returns, the more probably.

    The luck of an object hangs on where it is from the sensor alone, in centimetres: it is the same
    for all policies while their cars drive alike, and more returns never lose an object. Where
    anything moves it is drawn anew at every keyframe; what stands before a car that stands keeps
    its luck.
    """

    def detect(self, cloud: Cloud, annotations: Annotations) -> tuple[Detections, Integers]:
        """See `care_sim.perception.base.Detector`."""
        order = np.argsort(annotations.objects)
        ascending = annotations.objects[order]
        rows = np.searchsorted(ascending, cloud.objects)
        rows = rows[np.isin(cloud.objects, ascending)]
        returns = np.zeros(len(annotations), np.int64)
        returns[order] = np.bincount(rows, minlength=len(annotations))
        chances = np.zeros(len(annotations))
        for number, name in enumerate(CLASSES):
            of_class = annotations.classes == number
            chances[of_class] = chance(name, returns[of_class])
        (found,) = np.nonzero(_luck(annotations.boxes) < chances)
        detections = Detections(
            annotations.classes[found], annotations.boxes[found], returns[found]
        )
        return detections, annotations.objects[found]


def _luck(boxes: Floats) -> Floats:
    """(n,) from 0 to 1, evenly spread, from where the centres of boxes (n, 7) are in whole
    centimetres: the same on every processor whose arithmetic agrees that far.
    """
    x, y = (np.round(boxes[:, axis] * 100).astype(np.int64).astype(np.uint64) for axis in (0, 1))
    # The finaliser of SplitMix64 (Steele, Lea and Flood 2014), which leaves no trace of its input.
    mixed = x * np.uint64(0x9E3779B97F4A7C15) + y * np.uint64(0xD1B54A32D192ED03)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        mixed = (mixed ^ (mixed >> np.uint64(shift))) * np.uint64(factor)
    mixed ^= mixed >> np.uint64(31)
    return np.asarray((mixed >> np.uint64(11)) / 2.0**53)
