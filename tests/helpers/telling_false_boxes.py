"""How well a gradient-boosted classifier tells false camera boxes from true ones by all that an
observation shows of them.
"""

import numpy as np
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.metrics import roc_auc_score

from tests.helpers.kitti_object import overlaps


def visible(rows):
    """(n, k) of boxes (n, 7: class, score, edges, picture): own numbers, parts of pixels, and how
    they lie among the others of their picture.
    """
    label, score = rows[:, 0], np.clip(rows[:, 1], 1e-6, 1 - 1e-6)
    logit = np.log(score / (1 - score))
    size = rows[:, 4:6] - rows[:, 2:4]
    among = np.zeros((len(rows), 7))
    for picture in np.unique(rows[:, 6]):
        (own,) = np.nonzero(rows[:, 6] == picture)
        union, _ = overlaps(rows[own, 2:6], rows[own, 2:6])
        np.fill_diagonal(union, 0.0)
        alike = label[own, None] == label[own]
        middles = (rows[own, 2:4] + rows[own, 4:6]) / 2
        away = np.linalg.norm(middles[:, None] - middles, axis=2) / size[own, 1:]
        np.fill_diagonal(away, 50.0)
        nearest = union.argmax(axis=1)
        lead = np.where(union.max(axis=1) > 0, logit[own][nearest] - logit[own], 0.0)
        rank = np.argsort(np.argsort(-score[own]))
        counts = np.full(len(own), len(own)), alike.sum(axis=1)
        near = union.max(axis=1), (union * alike).max(axis=1), np.minimum(away.min(axis=1), 50)
        among[own] = np.column_stack([*counts, *near, rank, lead])
    parts = rows[:, 2:6] - np.floor(rows[:, 2:6])
    return np.column_stack([label, logit, rows[:, 2:6], size, parts, among])


def area_under_the_curve(rows, false, half):
    """Mean over both ways: learned from one `half` (n,) 0 or 1 of the boxes, asked of the other."""
    seen = visible(rows)
    areas = []
    for part in (0, 1):
        model = HistGradientBoostingClassifier(
            max_iter=150,
            learning_rate=0.06,
            max_leaf_nodes=15,
            l2_regularization=1.0,
            min_samples_leaf=20,
            random_state=0,
        ).fit(seen[half != part], false[half != part])
        chances = model.predict_proba(seen[half == part])[:, 1]
        areas.append(roc_auc_score(false[half == part], chances))
    return float(np.mean(areas))
