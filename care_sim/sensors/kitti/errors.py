"""Errors of boxes, overlap, and which boxes suppress others."""

import math

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.base.hashing import normal
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.sensors.kitti.numbers import FARTHEST, Numbers

CUT = 3
"""The row of `Numbers.tails` of edges that the picture cuts."""
LEAST_IOU = 0.52
"""A box that overlaps its label less would not count as its own: errors are drawn again."""
SMALL_PX = 4.0
"""Labels narrower or lower than this may err as they like."""
TRIES = 25
"""Draws of errors before the label's own box is reported."""


@compiled()
def iou(one: Floats, other: Floats) -> float:
    """Intersection over union of two boxes (4,)."""
    wide = min(one[2], other[2]) - max(one[0], other[0])
    high = min(one[3], other[3]) - max(one[1], other[1])
    if wide <= 0 or high <= 0:
        return 0.0
    both = (one[2] - one[0]) * (one[3] - one[1]) + (other[2] - other[0]) * (other[3] - other[1])
    return float(wide * high / (both - wide * high))


@compiled()
def lay_clipped(box: Floats, picture: Floats, into: Floats) -> None:
    """Fill `into` (4,) with what a picture (`labels.pictures_of`) shows of a box."""
    for j in range(4):
        into[j] = min(max(box[j], 0.0), picture[j % 2])


@compiled()
def lay_erring(
    box: Floats,
    seen_as: tuple[int, int, float],
    cut: Mask,
    normals: Floats,
    picture: Floats,
    numbers: Numbers,
    into: Floats,
) -> None:
    """Fill `into` (4,) with a box after errors, which four independent `normals` decide.

    `seen_as` are its kind, level of occlusion and score. Errors are relative to the size; those of
    `cut` (4,) edges are in pixels.
    """
    kind, level, score = seen_as
    sizes = max(box[2] - box[0], 2.0), max(box[3] - box[1], 2.0)
    sure = min(max(score, numbers.least_score), 0.9997)
    for j in range(4):
        shared = 0.0
        for k in range(j + 1):
            shared += numbers.edge_roots[kind, j, k] * normals[k]
        if cut[j]:
            error = _cut_error(j, shared, numbers)
        else:
            spread = _spread(numbers.edge_spreads[kind, j], sizes[1], level, sure)
            error = numbers.edge_means[kind, j] + spread * _tail(numbers.tails[kind, j], shared)
            error *= sizes[j % 2]
        into[j] = box[j] + error
    lay_clipped(into, picture, into)


@compiled()
def is_cut(box: Floats, j: int, picture: Floats) -> bool:
    """Whether the edge j of a box is at the edge of its picture."""
    return bool(box[j] <= 0 if j < 2 else box[j] >= picture[j - 2])


@compiled()
def lay_cut(key: np.uint64, first: int, picture: Floats, numbers: Numbers, box: Floats) -> None:
    """Let the edges of a box (4,) that its picture cuts err as those of objects, by the normal
    numbers of a key from the number `first` on.
    """
    for j in range(4):
        if is_cut(box, j, picture):
            box[j] += _cut_error(j, normal(key, first + j), numbers)
    lay_clipped(box, picture, box)


@compiled()
def _cut_error(j: int, score: float, numbers: Numbers) -> float:
    """Pixels by which a cut edge j errs at a normal score."""
    middle, spread = numbers.cut_errors[j]
    return float(middle + spread * _tail(numbers.tails[CUT, j], score))


@compiled()
def _spread(coefficients: Floats, height: float, level: int, score: float) -> float:
    """Spread of an edge's error: one, height, three levels, logit of the score."""
    logarithm = coefficients[0] + coefficients[1] * math.log(height / 50)
    if level:
        logarithm += coefficients[1 + level]
    return math.exp(logarithm + coefficients[5] * (math.log(score / (1 - score)) - 4))


@compiled()
def _tail(tail: Floats, score: float) -> float:
    """The error at a normal score, linear between those of `Numbers.tails`."""
    place = (min(max(score, -FARTHEST), FARTHEST) + FARTHEST) / (2 * FARTHEST) * (len(tail) - 1)
    low = min(int(place), len(tail) - 2)
    return float(tail[low] + (place - low) * (tail[low + 1] - tail[low]))


@compiled()
def resembles(box: Floats, label: Floats) -> bool:
    """Whether a box is near enough to the label that it reports."""
    small = min(label[2] - label[0], label[3] - label[1]) < SMALL_PX
    return bool(iou(box, label) >= LEAST_IOU or small)


@compiled()
def lay_normals(key: np.uint64, first: int, into: Floats) -> None:
    """Fill `into` (k,) with the normal numbers of a key from the number `first` on."""
    for j in range(len(into)):
        into[j] = normal(key, first + j)


@compiled()
def overlaps_any(
    box: Floats, label: int, boxes: Floats, classes: Integers, count: int, most: float
) -> bool:
    """Whether a box overlaps one of the first `count` of its class by more than `most`."""
    overlaps = False
    for n in range(count):
        overlaps |= classes[n] == label and iou(box, boxes[n]) > most
    return overlaps


@compiled()
def surest_of(scores: Floats) -> Integers:
    """(n,) the places of scores, the highest first."""
    order = np.empty(len(scores), np.int64)
    for n in range(len(scores)):
        place = n
        while place > 0 and scores[order[place - 1]] < scores[n]:
            order[place] = order[place - 1]
            place -= 1
        order[place] = n
    return order


@compiled()
def kept(boxes: Floats, scores: Floats, classes: Integers, sources: Integers, most: float) -> Mask:
    """(n,) which boxes of a picture are reported: of two of a class that overlap by more than
    `most` the surer one.

    Recall already holds who is lost beside a false box. So an object (`sources` from 0) is
    suppressed by a surer object alone, and a false box by an object that is less sure, too.
    """
    order = surest_of(scores)
    stays = np.ones(len(boxes), np.bool_)
    for i in order:
        for j in order:
            if not stays[i] or j == i:
                continue
            surer = scores[i] > scores[j] and (sources[j] < 0 or sources[i] >= 0)
            if surer and classes[j] == classes[i] and iou(boxes[i], boxes[j]) > most:
                stays[j] = False
    for i in order:
        for j in order:
            object_wins = sources[i] < 0 and sources[j] >= 0 and stays[j]
            if object_wins and classes[j] == classes[i] and iou(boxes[i], boxes[j]) > most:
                stays[i] = False
    return stays
