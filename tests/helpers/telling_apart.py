"""Small classifiers of single camera boxes: how well can true ones and false ones be told apart by
their numbers?
"""

import numpy as np
from scipy.optimize import minimize
from scipy.spatial import cKDTree
from scipy.stats import rankdata

from care_sim.core.types import CLASSES

BOXES = 300
"""Boxes of each kind to learn from, and as many to be tested on."""
CHANCE = 0.07
"""How far from 0.5 the area under the curve may be: for n boxes of each kind that nothing tells
apart its standard error is 1 / sqrt(6 n) = 0.024 (Hanley and McNeil 1982); this is three of them,
for the farthest of three classifiers.
"""


def areas_under_the_curve(true, false, rng):
    """The area under the curve of every classifier, by name. `true` and `false` are tables of
    detections, one an episode; the first half of the episodes is learned from, the other tested on.
    """
    half = len(true) // 2
    learned, tested = (
        [_drawn(tables[part], rng) for tables in (true, false)]
        for part in (slice(half), slice(half, None))
    )
    seen, kinds = _features(np.concatenate(learned)), np.repeat([0.0, 1.0], BOXES)
    middle, spread = seen.mean(axis=0), seen.std(axis=0) + 1e-9
    seen, new = (seen - middle) / spread, (_features(np.concatenate(tested)) - middle) / spread
    return {name: _area(kinds == 1, model(seen, kinds, new)) for name, model in CLASSIFIERS.items()}


def _drawn(tables, rng):
    """BOXES rows, as many of every episode."""
    each = -(-BOXES // len(tables))
    return np.concatenate([rng.permutation(table)[:each] for table in tables])[:BOXES]


def _features(rows):
    """Class, confidence, visible pixels and how far they are from a whole number, edges, size,
    pixels of the area.
    """
    label, sure, left, top, right, bottom, camera = rows[:, :7].astype(float).T
    width, height = right - left, bottom - top
    pixels = 36 * sure / np.maximum(1 - sure, 1e-9)
    classes = label[:, None] == np.arange(len(CLASSES))
    numbers = (
        sure,
        np.log(pixels + 1),
        np.abs(pixels - np.rint(pixels)),
        left,
        top,
        right,
        bottom,
        width,
        height,
    )
    return np.column_stack(
        [classes, *numbers, np.log(width * height), pixels / (width * height), camera]
    )


def _area(positive, scores):
    ranks, count = rankdata(scores), positive.sum()
    return (ranks[positive].sum() - count * (count + 1) / 2) / (count * (len(positive) - count))


def _logistic(seen, kinds, new):
    def table(rows):
        return np.column_stack([np.ones(len(rows)), rows, rows**2])

    def loss(weights):
        scores = table(seen) @ weights
        error = 1 / (1 + np.exp(-np.clip(scores, -50, 50))) - kinds
        value = np.mean(np.logaddexp(0, scores) - kinds * scores) + 1e-3 * weights @ weights
        return value, table(seen).T @ error / len(kinds) + 2e-3 * weights

    return (
        table(new) @ minimize(loss, np.zeros(1 + 2 * seen.shape[1]), jac=True, method="L-BFGS-B").x
    )


def _neighbours(seen, kinds, new, number=15):
    return kinds[cKDTree(seen).query(new, number)[1]].mean(axis=1)


def _tree(seen, kinds, new, depth=5, least=15):
    """A decision tree by Gini impurity."""
    split = _best_split(seen, kinds, least) if depth and 0 < kinds.mean() < 1 else None
    if split is None:
        return np.full(len(new), (kinds.sum() + 1) / (len(kinds) + 2))
    column, cut = split
    below, scores = seen[:, column] <= cut, np.empty(len(new))
    for side, part in ((below, new[:, column] <= cut), (~below, new[:, column] > cut)):
        scores[part] = _tree(seen[side], kinds[side], new[part], depth - 1, least)
    return scores


def _best_split(seen, kinds, least):
    """Column and value, None where no side would keep `least` rows."""
    found = []
    sizes = np.arange(1, len(kinds))
    for column, values in enumerate(seen.T):
        order = np.argsort(values, kind="stable")
        below, edges = np.cumsum(kinds[order])[:-1], values[order]
        above = kinds.sum() - below
        impurity = below * (1 - below / sizes) + above * (1 - above / (len(kinds) - sizes))
        allowed = (sizes >= least) & (len(kinds) - sizes >= least) & (edges[1:] > edges[:-1])
        if allowed.any():
            best = np.where(allowed, impurity, np.inf).argmin()
            found.append((impurity[best], column, edges[best : best + 2].mean()))
    return min(found)[1:] if found else None


CLASSIFIERS = {"logistic regression": _logistic, "nearest neighbours": _neighbours, "tree": _tree}
