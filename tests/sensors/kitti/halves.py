"""How well a formula of recall that is fitted on one half of the pictures predicts the other."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from care_sim.core.types import CLASSES
from care_sim.sensors.kitti.numbers import CLASS_OF, FEATURES
from tests.helpers.kitti_object import as_labels, halves, matched
from tests.sensors.kitti.fit import KINDS, looks_of, recall_of

HEIGHTS = {
    "car": (0, 20, 25, 30, 40, 60, 80, 120, 180, 400),
    "pedestrian": (0, 40, 60, 80, 110, 160, 400),
    "bicycle": (0, 25, 40, 60, 400),
}
METRES = (0, 10, 15, 20, 25, 30, 40, 50, 60, 90)
BEYOND = (-1.0, 0.001, 0.15, 0.3, 0.5, 1.01)
CONFIDENCE = 0.25
FEWEST = 100


class Bin(NamedTuple):
    """Shares of the `count` labels of a bin in one half of the pictures: `found` by the detector,
    and `predicted` by a formula that was fitted on the other half.
    """

    name: str
    count: int
    found: float
    predicted: float

    @property
    def error(self):
        return self.predicted - self.found


def held_out(told):
    """All bins of more than FEWEST labels of one half of the pictures, then of the other."""
    labels, rows = as_labels(told)
    found = np.isin(rows, matched(told, told.found[told.found[:, 1] >= CONFIDENCE]))
    return _held_out(labels, found, told.told[rows, 2])


def held_out_by_luck(told, repeats):
    """The same of a detector that the formula describes: each label is found by a chance of its
    own, which the formula fitted on all pictures gives.
    """
    labels, rows = as_labels(told)
    found = np.isin(rows, matched(told, told.found[told.found[:, 1] >= CONFIDENCE]))
    chances, rng = np.zeros(len(rows)), np.random.default_rng(0)
    for kind in KINDS:
        own = labels.kinds == kind
        chances[own] = _predicted(kind, labels, found, own)[own]
    draws = rng.random((repeats, len(rows))) < chances
    return [_held_out(labels, each, told.told[rows, 2]) for each in draws]


def _held_out(labels, found, metres):
    bins, side = [], halves()[labels.cameras]
    for kind in KINDS:
        own, named = labels.kinds == kind, _bins(CLASSES[CLASS_OF[kind]], labels, metres)
        for part in (0, 1):
            chances = _predicted(kind, labels, found, own & (side != part))
            for name, members in named:
                of = own & members & (side == part)
                if of.sum() > FEWEST:
                    bins.append(Bin(name, of.sum(), found[of].mean(), chances[of].mean()))
    return bins


def _predicted(kind, labels, found, own):
    """(n,) chances of all labels, from a formula that is fitted to the labels `own` (n,)."""
    table = recall_of(kind, labels, found, own, (0.5,))
    looks = looks_of(kind, labels, np.ones(len(own), bool))
    of = [FEATURES.index(name) for name in table["features"]]
    return 1 / (1 + np.exp(-looks[:, of] @ table["coefficients"][0]))


def _bins(label, labels, metres):
    """Names and masks of labels (n,), by level, height, both, distance and truncation."""
    height = labels.boxes[:, 3] - labels.boxes[:, 1]
    by_level = [(f"level {level}", labels.levels == level) for level in range(4)]
    by_height = [
        (f"{low} to {high} px", (height >= low) & (height < high))
        for low, high in pairwise(HEIGHTS[label])
    ]
    both = [(f"{a}, {b}", one & other) for a, one in by_height for b, other in by_level]
    far = [
        (f"{low} to {high} m", (metres >= low) & (metres < high)) for low, high in pairwise(METRES)
    ]
    cut = [
        (f"{max(low, 0):.3g} to {high:.3g} beyond", (labels.beyond > low) & (labels.beyond <= high))
        for low, high in pairwise(BEYOND)
    ]
    return [(f"{label}, {name}", own) for name, own in by_level + by_height + both + far + cut]
