"""False boxes beside objects: second and loose boxes.

Their number depends on the height, occlusion, cover and neighbours of the object, found or not.
Place and size are relative to the box that the detector reports of a found object, whose errors
they share, or to the label of a missed one.
"""

import math

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.base.hashing import uniform
from care_sim.core.arrays import Floats, Integers
from care_sim.sensors.kitti.draws import key_of
from care_sim.sensors.kitti.errors import iou, lay_cut
from care_sim.sensors.kitti.invented import (
    LEAST_HEIGHT,
    LEAST_WIDTH,
    MOST,
    TOUCHING,
    TRIES,
    Chance,
    Picture,
    add_box,
    drawn_columns,
    lay,
    low_of,
    pick_component,
    score_at,
)
from care_sim.sensors.kitti.labels import Labels
from care_sim.sensors.kitti.numbers import CAR, CLASS_OF

PAIRS = 2
"""Most pairs of `Numbers.pairs` that one kind of object has."""
NEIGHBOUR_HEIGHTS = 3.0
"""Objects whose middles are nearer than this many of their heights are neighbours."""
FOUND_IOU = 0.5
"""A box that overlaps a missed object's label by this much would count as its own."""


@compiled()
def add_beside(shown: Picture, reported: tuple[Floats, Floats], chance: Chance, count: int) -> int:
    """Add the false boxes beside the objects of a picture; return the new `count`.

    `reported` are the scores (n,) of all labels, 0 of missed ones, and their boxes (n, 4) with
    errors.
    """
    labels, numbers = shown.labels, shown.numbers
    for i in shown.own:
        place = labels.places[i]
        turn = 0
        for pair in range(len(numbers.pairs)):
            if numbers.pairs[pair, 0] != labels.kinds[i]:
                continue
            rate = _rate(labels, shown.own, i, numbers.pair_rates[pair])
            for n in range(MOST):
                slot = turn * MOST + n
                key = key_of(chance.key, place, slot, chance.beside[place, slot])
                if uniform(key, 0) >= _further(rate, n):
                    break
                keys = key, key_of(chance.now, place, slot, 2)
                count += _place_beside(shown, i, pair, keys, reported, count)
            turn += 1
    return count


@compiled()
def _rate(labels: Labels, own: Integers, i: int, coefficients: Floats) -> float:
    """Mean number of false boxes beside an object."""
    rate = coefficients[0]
    looks = rate_looks(labels, own, i)
    for k in range(len(looks)):
        rate += coefficients[1 + k] * looks[k]
    return math.exp(min(max(rate, -12.0), 0.7))


@compiled()
def rate_looks(labels: Labels, own: Integers, i: int) -> Floats:
    """(7,) size, its square, levels 1 to 3 of occlusion, cover and neighbours of an object among
    the objects `own` (k,) of its picture.
    """
    box, looks = labels.boxes[i], np.zeros(7)
    height = box[3] - box[1]
    neighbours = 0
    for j in own:
        away = abs(labels.boxes[j, 0] + labels.boxes[j, 2] - box[0] - box[2]) / 2
        alike = (labels.kinds[j] == CAR) == (labels.kinds[i] == CAR)
        neighbours += j != i and alike and away < NEIGHBOUR_HEIGHTS * height
    looks[0] = math.log(min(max(height, 15.0), 250.0) / 50)
    looks[1] = looks[0] * looks[0]
    if labels.levels[i]:
        looks[1 + labels.levels[i]] = 1.0
    looks[5], looks[6] = labels.cover[i], math.log(1.0 + neighbours)
    return looks


@compiled()
def _further(rate: float, count: int) -> float:
    """The chance of a Poisson number above `count`, if it is at least that."""
    term = math.exp(-rate)
    at_least = 1.0
    for n in range(count):
        at_least -= term
        term *= rate / (n + 1)
    return (at_least - term) / at_least


@compiled()
def _place_beside(
    shown: Picture,
    i: int,
    pair: int,
    keys: tuple[np.uint64, np.uint64],
    reported: tuple[Floats, Floats],
    at: int,
) -> bool:
    """Lay the false box of a pair into row `at`; return False if no place is free."""
    labels, numbers, into, box = shown.labels, shown.numbers, shown.into, reported[1][i]
    wide, high = box[2] - box[0], box[3] - box[1]
    mixture = numbers.pair_mixtures[pair]
    like = _likely(mixture, math.log((labels.boxes[i, 3] - labels.boxes[i, 1]) / 50))
    kind = numbers.pairs[pair, 1]
    label = labels.classes[i] if kind == CAR else CLASS_OF[kind]
    low = low_of(labels.boxes[i], shown.frame[3])
    for t in range(TRIES):
        first = 8 * t + 1
        pick = pick_component(like, uniform(keys[0], 2 * first - 1))
        drawn = drawn_columns(mixture, pick, keys, first, numbers.score_share)
        size = wide * math.exp(drawn[2]), high * math.exp(drawn[3])
        middle = (box[0] + box[2]) / 2 + drawn[0] * wide
        foot = box[3] + drawn[1] * high + low * (size[1] - high)
        lay(middle, foot, size, shown.frame, into.edges[at])
        lay_cut(keys[1], 4 * t + 1, shown.frame, numbers, into.edges[at])
        if _fits_beside(shown, i, label, into.edges[at], reported):
            add_box(into, at, label, score_at(numbers.pair_scores[pair], drawn[4], numbers))
            return True
    return False


@compiled()
def _fits_beside(
    shown: Picture, i: int, label: int, box: Floats, reported: tuple[Floats, Floats]
) -> bool:
    """Whether a false box counts as one, and no found object of its class suppresses it."""
    if box[2] - box[0] <= LEAST_WIDTH or box[3] - box[1] <= LEAST_HEIGHT:
        return False
    labels, most = shown.labels, shown.numbers.suppression_iou
    for j in shown.own:
        if labels.classes[j] != label:
            continue
        if reported[0][j] > 0:
            if iou(box, reported[1][j]) > most:
                return False
        elif iou(box, labels.boxes[j]) >= FOUND_IOU:
            return False
    return iou(box, labels.boxes[i]) >= TOUCHING


@compiled()
def _likely(mixture: Floats, last: float) -> Floats:
    """(k,) weights of components when the last column is known."""
    columns = (mixture.shape[1] - 1) // 2
    weights = np.empty(len(mixture))
    for n in range(len(mixture)):
        spread = mixture[n, 2 * columns]
        away = (last - mixture[n, columns]) / spread
        weights[n] = mixture[n, 0] * math.exp(-away * away / 2) / spread
    total = weights.sum()
    # So far from all components that nothing is likely: as if nothing were known.
    for n in range(len(weights)):
        weights[n] = weights[n] / total if total > 0 else mixture[n, 0]
    return weights
