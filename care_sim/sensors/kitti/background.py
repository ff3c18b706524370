"""False boxes of the background, and those that conditions add."""

import math

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.base.hashing import normal, uniform
from care_sim.core.arrays import Floats, Integers
from care_sim.core.rows import copy_row
from care_sim.sensors.kitti.draws import key_of
from care_sim.sensors.kitti.errors import iou, is_cut, lay_erring, lay_normals, resembles
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
from care_sim.sensors.kitti.labels import KINDS, Labels
from care_sim.sensors.kitti.numbers import CLASS_OF, FOCAL_PX, Numbers

EDGE_PX = 20.0, 36.0, 23.0
"""Boxes of the cut mixture end so near the left, right or lower edge of KITTI's pictures."""
FITTED_HALF_PX, FITTED_BELOW_PX = 621.0, 202.1
"""Half the width of KITTI's pictures, and how far they reach below the horizon."""

_KINDS = tuple(KINDS.tolist())


@compiled()
def add_scene(shown: Picture, chance: Chance, count: int) -> int:
    """Add the false boxes of the background of a picture; return the new `count`."""
    for kind in range(len(shown.numbers.scene_counts)):
        for n in range(MOST):
            slot = kind * MOST + n
            # Objects count from 0 as well: pictures follow them.
            place = len(chance.beside) + shown.number
            key = key_of(chance.key, place, slot, chance.scene[shown.number, slot])
            if uniform(key, 0) >= shown.numbers.scene_counts[kind, n]:
                break
            keys = key, key_of(chance.now, place, slot, 2)
            count += _place_scene(shown, kind, keys, count)
    return count


@compiled()
def usual_low(labels: Labels, own: Integers, kind: int, picture: Floats, usual: float) -> float:
    """The mean of `low_of` of the picture's objects of a kind, else KITTI's `usual` one at the
    camera's height.
    """
    total, count = 0.0, 0
    for j in own:
        if labels.classes[j] == CLASS_OF[kind] and not labels.cut[j, 3]:
            total += low_of(labels.boxes[j], picture[3])
            count += 1
    return float(total / count if count else usual * picture[4])


@compiled()
def _place_scene(shown: Picture, kind: int, keys: tuple[np.uint64, np.uint64], at: int) -> bool:
    """Lay a false box of the background into row `at`; return False if no place is free."""
    numbers, picture, into = shown.numbers, shown.frame, shown.into
    cut = uniform(keys[0], 1) < numbers.scene_cuts[kind]
    mixture = numbers.scene_mixtures[kind, int(cut)]
    weights = mixture[:, 0].copy()
    low = usual_low(shown.labels, shown.own, kind, picture, numbers.usual_lows[kind])
    for t in range(TRIES):
        first = 8 * t + 2
        pick = pick_component(weights, uniform(keys[0], 2 * first - 1))
        drawn = drawn_columns(mixture, pick, keys, first, numbers.score_share)
        high = 50 * math.exp(drawn[0])
        # Cut boxes lie at the edges: their places are relative to the picture's.
        ahead = picture[0] / 2 / FITTED_HALF_PX if cut else 1.0
        middle = picture[2] + FOCAL_PX * drawn[3] * ahead
        foot = picture[3] + drawn[2] * (100.0 if cut else high * low)
        box = into.edges[at]
        lay(middle, foot, (high * math.exp(drawn[1]), high), picture, box)
        stays = not cut or _ends_near_edges(box, foot, picture)
        stays = stays and 0 < middle < picture[0] and foot - high > 0
        if stays and _fits_scene(shown.labels, shown.own, kind, box, numbers.pairs):
            score = score_at(numbers.scene_scores[kind], drawn[4], numbers)
            add_box(into, at, CLASS_OF[kind], score)
            # The errors that last are in the mixture already.
            add_errors(box, kind, score, (keys[1], 1 - numbers.edges_share), picture, numbers)
            return True
    return False


@compiled()
def _ends_near_edges(box: Floats, foot: float, picture: Floats) -> bool:
    """Whether a box ends near an edge at the side of its picture, or the lower one of KITTI's
    pictures, which end nearer to the horizon.
    """
    left, right, below = EDGE_PX
    aside = box[0] < left or box[2] > picture[0] - right
    return bool(aside or foot > picture[3] + FITTED_BELOW_PX - below)


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
def add_lent(
    shown: Picture, lent: tuple[Integers, Floats, Integers], key: np.uint64, count: int
) -> int:
    """Add those of further false boxes that are in a picture, with errors and scores as of the
    background; return the new `count`. They are classes (l,), edges (l, 4) and pictures (l,).
    """
    into, numbers = shown.into, shown.numbers
    for n in range(len(lent[0])):
        if lent[2][n] != shown.number:
            continue
        kind = _KINDS[lent[0][n]]
        own = key_of(key, n, 0, 0)
        score = score_at(numbers.scene_scores[kind], normal(own, 0), numbers)
        add_box(into, count, lent[0][n], score)
        copy_row(lent[1][n], into.edges[count])
        add_errors(into.edges[count], kind, score, (own, 1.0), shown.frame, numbers)
        count += 1
    return count


@compiled()
def add_errors(
    box: Floats,
    kind: int,
    score: float,
    chance: tuple[np.uint64, float],
    picture: Floats,
    numbers: Numbers,
) -> None:
    """Let a false box (4,) err as objects do. `chance` is a key, and the share of the variance of
    an object's normal numbers that those of the key have.
    """
    whole, normals, cut = np.empty(4), np.empty(4), np.empty(4, np.bool_)
    copy_row(box, whole)
    lay_normals(chance[0], 1, normals)
    for j in range(4):
        normals[j] *= math.sqrt(chance[1])
        cut[j] = is_cut(whole, j, picture)
    lay_erring(whole, (kind, 0, score), cut, normals, picture, numbers, box)
    if not resembles(box, whole):
        copy_row(whole, box)
