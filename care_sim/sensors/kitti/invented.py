"""Tools that draw both kinds of false boxes: mixtures of normal distributions with independent
columns, and where on the road a box ends.

The lower edge of a false box is relative to a box of its size that stands on the road as objects
do, because real false boxes follow the road.
"""

import math
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.base.hashing import normal
from care_sim.core.arrays import Floats, Integers
from care_sim.sensors.kitti.errors import lay_clipped
from care_sim.sensors.kitti.labels import Labels
from care_sim.sensors.kitti.numbers import Numbers

MOST = 3
"""False boxes of one kind beside an object, and of the background of a picture."""
LEAST_WIDTH, LEAST_HEIGHT = 4.0, 8.0
"""Pixels of a false box."""
TRIES = 15
"""Places that are tried before a false box is left out."""
TOUCHING = 0.1
"""A false box beside an object overlaps its label by at least this, one of the background less."""


class Chance(NamedTuple):
    """Random sources of a keyframe: a `key` of false boxes, a key of the keyframe (`now`), normal
    numbers of objects, and the first keyframe of each lasting false box.
    """

    key: np.uint64
    now: np.uint64
    luck: Floats
    """(objects,)."""
    edges: Floats
    """(objects, 4)."""
    beside: Integers
    """(objects, PAIRS * MOST)."""
    scene: Integers
    """(pictures, 3 * MOST)."""


class Boxes(NamedTuple):
    """Room for the boxes of a picture: `sources` are their labels, -1 for false ones."""

    classes: Integers
    scores: Floats
    edges: Floats
    sources: Integers


class Picture(NamedTuple):
    """A picture: the objects in it, and the buffers for its boxes."""

    labels: Labels
    own: Integers
    """(k,) the objects in it."""
    number: int
    frame: Floats
    """(5,) a row of `labels.pictures_of`."""
    numbers: Numbers
    into: Boxes


@compiled()
def low_of(box: Floats, horizon: float) -> float:
    """How many of its heights a box ends below the horizon. Objects of one height on one road have
    about the same, however far away.
    """
    return float(min(max((box[3] - horizon) / max(box[3] - box[1], 1.0), 0.2), 2.0))


@compiled()
def lay(
    middle: float, foot: float, size: tuple[float, float], picture: Floats, into: Floats
) -> None:
    """Fill `into` (4,) with a box by its middle column, its lower edge and its size."""
    into[0], into[1] = middle - size[0] / 2, foot - size[1]
    into[2], into[3] = middle + size[0] / 2, foot
    lay_clipped(into, picture, into)


@compiled()
def add_box(into: Boxes, at: int, label: int, score: float) -> None:
    """Enter the class and score of a false box in row `at`."""
    into.classes[at], into.scores[at], into.sources[at] = label, score, -1


@compiled()
def pick_component(weights: Floats, draw: float) -> int:
    """The component that a number from 0 to 1 picks."""
    total = 0.0
    last = 0
    for n in range(len(weights)):
        if weights[n] > 0:
            last = n
        total += weights[n]
        if draw < total:
            return n
    return last


@compiled()
def drawn_columns(
    mixture: Floats, component: int, keys: tuple[np.uint64, np.uint64], first: int, share: float
) -> Floats:
    """(5,) columns of a component. The last one is the score: the first key, of the box, gives a
    `share` of its variance, the second, of the keyframe, the rest.
    """
    columns = (mixture.shape[1] - 1) // 2
    row = mixture[component]
    drawn = np.empty(5)
    for j in range(5):
        number = normal(keys[0], first + j)
        if j == 4:
            number = math.sqrt(share) * number + math.sqrt(1 - share) * normal(keys[1], 0)
        drawn[j] = row[1 + j] + row[1 + columns + j] * number
    return drawn


@compiled()
def score_at(table: Floats, score: float, numbers: Numbers) -> float:
    """The score at a normal score, by a table of logits at `score_shares`."""
    share = 0.5 * math.erfc(-score / math.sqrt(2.0))
    return 1 / (1 + math.exp(-np.interp(share, numbers.score_shares, table)))
