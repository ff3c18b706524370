"""False boxes: second and loose boxes beside objects, and boxes of the background.

Beside an object, found or not, their number depends on its height, occlusion, cover and neighbours;
place and size are relative to the box that the detector makes of the object, whose errors they
share. Those of the background have places and sizes of their own. Both are mixtures of normal
distributions with independent columns. The lower edge of both is counted from where a box of that
size would end that stands on the road as objects do: real false boxes follow the road.
"""

import math
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers
from care_sim.sensors.kitti.draws import key_of, normal, uniform
from care_sim.sensors.kitti.errors import copy_box, iou, lay_clipped, lay_erring, resembles
from care_sim.sensors.kitti.labels import KINDS, Labels
from care_sim.sensors.kitti.numbers import CAR, CLASS_OF, FOCAL_PX, Numbers

MOST = 3
"""False boxes of one kind beside an object, and of the background of a picture."""
PAIRS = 2
"""Most pairs of `Numbers.pairs` that one kind of object has."""
LEAST_WIDTH, LEAST_HEIGHT = 4.0, 8.0
"""Pixels of a false box."""
TRIES = 15
"""Places that are tried before a false box is left out."""
NEIGHBOUR_HEIGHTS = 3.0
"""Objects whose middles are nearer than this many of their heights are neighbours."""
TOUCHING = 0.1
"""A false box beside an object overlaps its label by at least this, one of the background less."""
FOUND_IOU = 0.5
"""A box that overlaps a missed object's label by this much would count as its own."""
EDGE_PX = 20.0, 36.0, 23.0
"""Boxes of the cut mixture are cut if they end so near the left, right and lower edge."""
FITTED_HALF_PX, FITTED_BELOW_PX = 621.0, 202.1
"""Half the width of KITTI's pictures, and how far they reach below the horizon."""

USUAL_LOWS = 1.08, 0.94, 0.94
"""Means of `low_of` of the three kinds on KITTI: the camera's height, 1.65 m, over theirs."""

_KINDS = tuple(KINDS.tolist())


class Chance(NamedTuple):
    """What false boxes are drawn from: a `key`, a key of the keyframe (`now`), and the keyframe
    since which each lasts.
    """

    key: np.uint64
    now: np.uint64
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


@compiled()
def add_beside(
    labels: Labels,
    own: Integers,
    reported: tuple[Floats, Floats],
    picture: Floats,
    chance: Chance,
    numbers: Numbers,
    into: Boxes,
    count: int,
) -> int:
    """Add the false boxes beside the objects `own` (k,) of a picture; return the new `count`.

    `reported` are the scores (n,) of all labels, 0 of missed ones, and their boxes (n, 4) with
    errors.
    """
    for i in own:
        place = labels.places[i]
        turn = 0
        for pair in range(len(numbers.pairs)):
            if numbers.pairs[pair, 0] != labels.kinds[i]:
                continue
            rate = _rate(labels, own, i, numbers.pair_rates[pair])
            for n in range(MOST):
                slot = turn * MOST + n
                key = key_of(chance.key, place, slot, chance.beside[place, slot])
                if uniform(key, 0) >= _further(rate, n):
                    break
                keys = key, key_of(chance.now, place, slot, 2)
                if _place_beside(
                    labels, own, i, pair, keys, reported, picture, numbers, into, count
                ):
                    count += 1
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
def low_of(box: Floats, horizon: float) -> float:
    """How many of its heights a box ends below the horizon. Whoever stands on one road has about
    the same, however far away.
    """
    return float(min(max((box[3] - horizon) / max(box[3] - box[1], 1.0), 0.2), 2.0))


@compiled()
def usual_low(labels: Labels, own: Integers, kind: int, picture: Floats) -> float:
    """The mean of `low_of` of the picture's objects of a kind, else the usual one."""
    total, count = 0.0, 0
    for j in own:
        if labels.classes[j] == CLASS_OF[kind] and not labels.cut[j, 3]:
            total += low_of(labels.boxes[j], picture[3])
            count += 1
    return float(total / count if count else USUAL_LOWS[kind])


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
    labels: Labels,
    own: Integers,
    i: int,
    pair: int,
    keys: tuple[np.uint64, np.uint64],
    reported: tuple[Floats, Floats],
    picture: Floats,
    numbers: Numbers,
    into: Boxes,
    at: int,
) -> bool:
    """Lay the false box of a pair into row `at`; return False if no place is free."""
    box = reported[1][i]
    wide, high = box[2] - box[0], box[3] - box[1]
    mixture = numbers.pair_mixtures[pair]
    like = _likely(mixture, math.log((labels.boxes[i, 3] - labels.boxes[i, 1]) / 50))
    kind = numbers.pairs[pair, 1]
    label = labels.classes[i] if kind == CAR else CLASS_OF[kind]
    low = low_of(labels.boxes[i], picture[3])
    for t in range(TRIES):
        first = 8 * t + 1
        pick = _pick(like, uniform(keys[0], 2 * first - 1))
        drawn = _drawn(mixture, pick, keys, first, numbers.score_share)
        size = wide * math.exp(drawn[2]), high * math.exp(drawn[3])
        middle = (box[0] + box[2]) / 2 + drawn[0] * wide
        foot = box[3] + drawn[1] * high + low * (size[1] - high)
        _lay(middle, foot, size, picture, into.edges[at])
        if _fits_beside(labels, own, i, label, into.edges[at], reported, numbers.suppression_iou):
            _tell(into, at, label, _score(numbers.pair_scores[pair], drawn[4], numbers))
            return True
    return False


@compiled()
def _fits_beside(
    labels: Labels,
    own: Integers,
    i: int,
    label: int,
    box: Floats,
    reported: tuple[Floats, Floats],
    most: float,
) -> bool:
    """Whether a false box counts as one, and no found object of its class suppresses it."""
    if box[2] - box[0] <= LEAST_WIDTH or box[3] - box[1] <= LEAST_HEIGHT:
        return False
    for j in own:
        if labels.classes[j] != label:
            continue
        if reported[0][j] > 0:
            if iou(box, reported[1][j]) > most:
                return False
        elif iou(box, labels.boxes[j]) >= FOUND_IOU:
            return False
    return iou(box, labels.boxes[i]) >= TOUCHING


@compiled()
def add_scene(
    labels: Labels,
    own: Integers,
    number: int,
    picture: Floats,
    chance: Chance,
    numbers: Numbers,
    into: Boxes,
    count: int,
) -> int:
    """Add the false boxes of the background of picture `number`; return the new `count`."""
    for kind in range(len(numbers.scene_counts)):
        for n in range(MOST):
            slot = kind * MOST + n
            # Objects count from 0 as well: pictures follow them.
            place = len(chance.beside) + number
            key = key_of(chance.key, place, slot, chance.scene[number, slot])
            if uniform(key, 0) >= numbers.scene_counts[kind, n]:
                break
            keys = key, key_of(chance.now, place, slot, 2)
            if _place_scene(labels, own, kind, keys, picture, numbers, into, count):
                count += 1
    return count


@compiled()
def _place_scene(
    labels: Labels,
    own: Integers,
    kind: int,
    keys: tuple[np.uint64, np.uint64],
    picture: Floats,
    numbers: Numbers,
    into: Boxes,
    at: int,
) -> bool:
    """Lay a false box of the background into row `at`; return False if no place is free."""
    cut = uniform(keys[0], 1) < numbers.scene_cuts[kind]
    mixture = numbers.scene_mixtures[kind, int(cut)]
    weights, low = mixture[:, 0].copy(), usual_low(labels, own, kind, picture)
    for t in range(TRIES):
        first = 8 * t + 2
        pick = _pick(weights, uniform(keys[0], 2 * first - 1))
        drawn = _drawn(mixture, pick, keys, first, numbers.score_share)
        high = 50 * math.exp(drawn[0])
        # Cut boxes lie at the edges: their places are relative to the picture's.
        ahead = picture[0] / 2 / FITTED_HALF_PX if cut else 1.0
        middle = picture[2] + FOCAL_PX * drawn[3] * ahead
        foot = picture[3] + drawn[2] * (100.0 if cut else high * low)
        box = into.edges[at]
        _lay(middle, foot, (high * math.exp(drawn[1]), high), picture, box)
        stays = not cut or _reach_edges(box, foot, picture)
        stays = stays and 0 < middle < picture[0] and foot - high > 0
        if stays and _fits_scene(labels, own, kind, box, numbers.pairs):
            _tell(into, at, CLASS_OF[kind], _score(numbers.scene_scores[kind], drawn[4], numbers))
            let_err(box, kind, into.scores[at], keys[0], 8 * TRIES + 2, picture, numbers)
            return True
    return False


@compiled()
def let_err(
    box: Floats,
    kind: int,
    score: float,
    key: np.uint64,
    first: int,
    picture: Floats,
    numbers: Numbers,
) -> None:
    """Let a false box (4,) err as objects do, by the normal numbers of a key from `first` on."""
    whole, normals, cut = np.empty(4), np.empty(4), np.empty(4, np.bool_)
    copy_box(box, whole)
    for j in range(4):
        normals[j] = normal(key, first + j)
        cut[j] = whole[j] <= 0 if j < 2 else whole[j] >= picture[j - 2]
    lay_erring(whole, (kind, 0, score), cut, normals, picture, numbers, box)
    if not resembles(box, whole):
        copy_box(whole, box)


@compiled()
def add_lent(
    lent: tuple[Integers, Floats, Integers],
    number: int,
    picture: Floats,
    key: np.uint64,
    numbers: Numbers,
    into: Boxes,
    count: int,
) -> int:
    """Add those of further false boxes that are in picture `number`, with errors and scores as of
    the background; return the new `count`. They are classes (l,), edges (l, 4) and pictures (l,).
    """
    for n in range(len(lent[0])):
        if lent[2][n] != number:
            continue
        kind = _KINDS[lent[0][n]]
        own = key_of(key, n, 0, 0)
        score = _score(numbers.scene_scores[kind], normal(own, 0), numbers)
        _tell(into, count, lent[0][n], score)
        copy_box(lent[1][n], into.edges[count])
        let_err(into.edges[count], kind, score, own, 1, picture, numbers)
        count += 1
    return count


@compiled()
def _reach_edges(box: Floats, foot: float, picture: Floats) -> bool:
    """Let a box that ends near an edge of the picture end there; return whether one does.

    KITTI's pictures end nearer to the horizon. A box at their lower edge counts as cut.
    """
    left, right, below = EDGE_PX
    near_left, near_right = box[0] < left, box[2] > picture[0] - right
    if near_left:
        box[0] = 0.0
    if near_right:
        box[2] = picture[0]
    if box[3] > picture[1] - below:
        box[3] = picture[1]
    return bool(near_left or near_right or foot > picture[3] + FITTED_BELOW_PX - below)


@compiled()
def _fits_scene(labels: Labels, own: Integers, kind: int, box: Floats, pairs: Integers) -> bool:
    """Whether a false box is large enough, and touches no object beside which it would belong."""
    if box[2] - box[0] <= LEAST_WIDTH or box[3] - box[1] <= LEAST_HEIGHT:
        return False
    for j in own:
        for pair in range(len(pairs)):
            belongs = pairs[pair, 0] == labels.kinds[j] and pairs[pair, 1] == kind
            if belongs and iou(box, labels.boxes[j]) >= TOUCHING:
                return False
    return True


@compiled()
def _lay(
    middle: float, foot: float, size: tuple[float, float], picture: Floats, into: Floats
) -> None:
    """Fill `into` (4,) with a box by its middle column, its lower edge and its size."""
    into[0], into[1] = middle - size[0] / 2, foot - size[1]
    into[2], into[3] = middle + size[0] / 2, foot
    lay_clipped(into, picture, into)


@compiled()
def _tell(into: Boxes, at: int, label: int, score: float) -> None:
    into.classes[at], into.scores[at], into.sources[at] = label, score, -1


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


@compiled()
def _pick(weights: Floats, draw: float) -> int:
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
def _drawn(
    mixture: Floats, component: int, keys: tuple[np.uint64, np.uint64], first: int, share: float
) -> Floats:
    """(5,) columns of a component. Of the last one, the score, a `share` of the variance is the
    box's, by the first key, and the rest the keyframe's, by the second.
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
def _score(table: Floats, score: float, numbers: Numbers) -> float:
    """The score at a normal score, by a table of logits at `score_shares`."""
    share = 0.5 * math.erfc(-score / math.sqrt(2.0))
    return 1 / (1 + math.exp(-np.interp(share, numbers.score_shares, table)))
