"""Fit the numbers of the profile `kitti` to the real detector's boxes in ../shared/data.

    python -m tests.sensors.kitti.fit care_sim/sensors/kitti/measured.json

All but TIMES is fitted to the pictures of KITTI's object benchmark. TIMES was read off pairs of
pictures of one drive (`tests/sensors/kitti/test_times.py`).
"""

import json
import re
import sys
from pathlib import Path

import numpy as np
from scipy import optimize, stats
from sklearn.linear_model import LogisticRegression, PoissonRegressor
from sklearn.mixture import GaussianMixture

from care_sim.sensors.kitti.background import EDGE_PX, usual_low
from care_sim.sensors.kitti.beside import rate_looks
from care_sim.sensors.kitti.invented import TOUCHING, low_of
from care_sim.sensors.kitti.numbers import CAR, CLASS_OF, CYCLIST, FEATURES, FOCAL_PX, PERSON
from care_sim.sensors.kitti.recall import features
from tests.helpers.kitti_object import PICTURE, as_labels, kitti_pictures, matched, overlaps

TIMES = {
    "luck": {"a": 0.76, "T_s": 1.29},
    "jitter_time": {"c": 0.36, "a": 0.44, "T_s": 0.49},
    "false_time": {"T_s": 0.36, "score_share": 0.85, "edges_share": 0.8},
}
THRESHOLDS = 0.05, 0.25, 0.5, 0.9, 0.97, 0.99, 0.997, 0.999, 0.9997
LEAST_SCORE = 0.1
SCORE_SHARES = 0, 0.1, 0.25, 0.5, 0.75, 0.9, 1
KINDS = CAR, PERSON, CYCLIST
NAMES = "Car", "Pedestrian", "Cyclist"
KNOTS = (15, 20, 26, 35, 55, 110, 220), (35, 50, 70, 100, 170), (22, 30, 42, 80)
LEFT_OUT = (
    (),
    ("metres", "metres^2"),
    (
        *("trunc^2", "occ1*log(h/40)", "occ2*log(h/40)", "occ1*shape", "occ2*shape"),
        *("metres", "metres^2", "cover", "cover^2"),
    ),
)
"""Features that a kind has too few labels for, or of which distance says nothing more."""
PAIRS = (CAR, CAR), (PERSON, PERSON), (PERSON, CYCLIST), (CYCLIST, PERSON), (CYCLIST, CYCLIST)
NO_TOP = 2.5, 0.0, 2.0
"""Degrees of freedom, middle and spread (assumed): no picture cuts a top."""
PER_COMPONENT = 35
"""Boxes per component of a mixture, of which there are at most ten."""
PER_CUT_COMPONENT = 8
"""The same of boxes that the picture cuts, which are few and lie at its three edges."""


def fitted(told):
    """The table of `measured.json`."""
    labels, rows = as_labels(told)
    boxes = told.found[told.found[:, 1] >= min(THRESHOLDS)]
    behind = matched(told, boxes)
    # The detector cut its edges to whole pixels, as the profile does again.
    boxes[:, 2:6] += 0.5
    reached, reported = np.zeros(len(rows)), labels.boxes.copy()
    own = np.searchsorted(rows, behind[behind >= 0])
    reached[own], reported[own] = boxes[behind >= 0, 1], boxes[behind >= 0, 2:6]
    sure, errors = reached >= LEAST_SCORE, reported - labels.boxes
    ends = [errors[sure & labels.cut[:, j], j] for j in range(4)]
    cut = [stats.t.fit(one) if len(one) else NO_TOP for one in ends]
    false = boxes[(behind == -1) & (boxes[:, 1] >= LEAST_SCORE)]
    beside, scene = _false(labels, reported, false, told.count)
    of_kinds = [labels.kinds == kind for kind in KINDS]
    return {
        "suppression_iou": 0.45,
        **TIMES,
        "classes": NAMES,
        "least_score": LEAST_SCORE,
        "thresholds": THRESHOLDS,
        "recall": [recall_of(k, labels, reached, of_kinds[k], THRESHOLDS) for k in KINDS],
        "jitter": [_jitter(labels, reached, reported, sure & of_kinds[k]) for k in KINDS],
        "cut_px": [[middle, spread, freedom] for freedom, middle, spread in cut],
        "beside": beside,
        "background": scene,
        "score_shares": SCORE_SHARES,
    }


def looks_of(kind, labels, own):
    """(n, 22) FEATURES of labels."""
    knots = np.concatenate([np.log(KNOTS[kind]), np.full(7 - len(KNOTS[kind]), np.inf)])
    width, height = (labels.boxes[own, 2:] - labels.boxes[own, :2]).T
    told = height, width, labels.levels[own], labels.beyond[own], labels.metres[own]
    told = zip(*told, labels.cover[own], strict=True)
    return np.array([features(kind, *one, knots) for one in told])


def recall_of(kind, labels, reached, own, thresholds):
    """The part `recall` of a kind. `reached` (n,) are scores, 0 of missed labels; `own` (n,) says
    which labels are of the kind.
    """
    unused = [f"height{n}" for n in range(len(KNOTS[kind]), 7)]
    names = [name for name in FEATURES if name not in (*LEFT_OUT[kind], *unused)]
    looks = looks_of(kind, labels, own)[:, [FEATURES.index(name) for name in names[1:]]]
    rows = []
    for least in thresholds:
        model = LogisticRegression(C=10.0, max_iter=5000).fit(looks, reached[own] >= least)
        rows.append([*model.intercept_, *model.coef_[0]])
    return {"knots": KNOTS[kind], "features": names, "coefficients": rows}


def _jitter(labels, reached, reported, own):
    """Errors of the edges that no picture cuts: Student's t, whose spread depends on the looks."""
    label, levels = labels.boxes[own], labels.levels[own]
    sizes = np.maximum(label[:, 2:] - label[:, :2], 2.0)
    errors = (reported[own] - label) / np.tile(sizes, 2)
    sure = np.minimum(reached[own], 0.9997)
    parts = [np.ones(len(sure)), np.log(sizes[:, 1] / 50), *(levels == n for n in (1, 2, 3))]
    looks = np.column_stack([*parts, np.log(sure / (1 - sure)) - 4])
    edges, normals = [], []
    for j in range(4):
        free = ~labels.cut[own, j]

        def unlikely(v, free=free, j=j):
            scale = np.exp(np.clip(looks @ v[1:7], -9, 3))
            standard = (errors[free, j] - v[0]) / scale[free]
            likely = stats.t.logpdf(standard, np.exp(v[7])) - np.log(scale[free])
            return (v[3:6] ** 2).sum() - likely.sum()

        bounds = [(-1, 1), (-7, 0), *[(-1, 1)] * 5, np.log([2.2, 40])]
        v = optimize.minimize(unlikely, [0, -3, 0, 0, 0, 0, 0, 1.5], bounds=bounds).x
        edges.append({"mean": v[0], "log_spread": v[1:7], "df": np.exp(v[7])})
        shares = stats.t.cdf((errors[:, j] - v[0]) / np.exp(looks @ v[1:7]), np.exp(v[7]))
        normals.append(stats.norm.ppf(np.clip(shares, 1e-6, 1 - 1e-6)))
    whole = ~labels.cut[own].any(axis=1)
    return {"edges": edges, "correlation": np.corrcoef(np.array(normals)[:, whole])}


def _false(labels, reported, false, count):
    """False boxes beside objects, by pairs of kinds, and those of the background."""
    kinds = np.array([CLASS_OF.index(label) for label in false[:, 0]])
    owners = np.full(len(false), -1)
    for n, box in enumerate(false):
        (own,) = np.nonzero(labels.cameras == box[6])
        own = [i for i in own if (labels.kinds[i], kinds[n]) in PAIRS]
        union = overlaps(box[None, 2:6], labels.boxes[own])[0][0] if own else np.zeros(1)
        if union.max() >= TOUCHING:
            owners[n] = own[union.argmax()]
    beside = [_beside(labels, reported, false, owners, kinds, pair) for pair in PAIRS]
    return beside, [_scene(labels, false[(owners < 0) & (kinds == k)], k, count) for k in KINDS]


def _beside(labels, reported, false, owners, kinds, pair):
    (own,) = np.nonzero(labels.kinds == pair[0])
    is_pair = (owners >= 0) & (labels.kinds[owners] == pair[0]) & (kinds == pair[1])
    numbers = np.bincount(owners[is_pair], minlength=len(labels.kinds))[own]
    looks = np.array([rate_looks(labels, _shown(labels, i), i) for i in own])
    model = PoissonRegressor(alpha=1 / len(own), max_iter=1000).fit(looks, numbers)
    boxes, behind = false[is_pair], owners[is_pair]
    base, label = reported[behind], labels.boxes[behind]
    (wide, high), (width, height) = (base[:, 2:] - base[:, :2]).T, (boxes[:, 4:6] - boxes[:, 2:4]).T
    aside = (boxes[:, 2] + boxes[:, 4] - base[:, 0] - base[:, 2]) / 2 / wide
    low = [low_of(one, PICTURE[3]) for one in label]
    foot = (boxes[:, 5] - base[:, 3]) / high - low * (height / high - 1)
    size = np.log((label[:, 3] - label[:, 1]) / 50)
    sizes = np.log(width / wide), np.log(height / high)
    return {
        "label": NAMES[pair[0]],
        "box": NAMES[pair[1]],
        "rate": [model.intercept_, *model.coef_],
        "mixture": _mixture(aside, foot, *sizes, _normal_scores(boxes[:, 1]), size),
        "scores": _score_table(boxes[:, 1]),
    }


def _scene(labels, boxes, kind, count):
    left, right, below = EDGE_PX
    cut = (boxes[:, 2] < left) | (boxes[:, 4] > PICTURE[0] - right) | (boxes[:, 5] > 375 - below)
    (width, height), score = (boxes[:, 4:6] - boxes[:, 2:4]).T, _normal_scores(boxes[:, 1])
    standing = labels.boxes[(labels.kinds == kind) & ~labels.cut[:, 3]]
    usual = np.mean([low_of(box, PICTURE[3]) for box in standing])
    lows = [_low(labels, kind, picture, usual) for picture in boxes[:, 6]]
    below_px, middle = boxes[:, 5] - PICTURE[3], (boxes[:, 2] + boxes[:, 4]) / 2 - PICTURE[2]
    shape = np.log(height / 50), np.log(width / height)
    whole, ended = (
        (*shape, foot, middle / FOCAL_PX, score)
        for foot in (below_px / height / lows, below_px / 100)
    )
    per_picture = np.bincount(boxes[:, 6].astype(int), minlength=1)
    zeros = count - np.count_nonzero(per_picture)
    numbers = np.append(per_picture[per_picture > 0], np.zeros(zeros))
    return {
        "box": NAMES[kind],
        "per_picture": numbers.mean(),
        "variance": numbers.var(),
        "usual_low": usual,
        "mixture": _mixture(*(column[~cut] for column in whole)),
        "cut_share": cut.mean(),
        "cut_mixture": _mixture(*(column[cut] for column in ended), boxes=PER_CUT_COMPONENT),
        "scores": _score_table(boxes[:, 1]),
    }


def _shown(labels, i):
    return np.nonzero(labels.cameras == labels.cameras[i])[0]


def _low(labels, kind, picture, usual):
    (own,) = np.nonzero(labels.cameras == picture)
    return usual_low(labels, own, kind, PICTURE, usual)


def _mixture(*columns, boxes=PER_COMPONENT):
    table = np.column_stack(columns)
    most = min(max(len(table) // boxes, 1), 10)
    model = GaussianMixture(most, covariance_type="diag", n_init=5, reg_covar=1e-3, random_state=0)
    model.fit(table)
    return {"weights": model.weights_, "means": model.means_, "covariances": model.covariances_}


def _normal_scores(scores):
    return stats.norm.ppf((stats.rankdata(scores) - 0.5) / len(scores))


def _score_table(scores):
    quantiles = np.quantile(scores, SCORE_SHARES)
    return np.log(quantiles / (1 - quantiles))


def as_text(table):
    """JSON with four decimals and a line per list of numbers."""
    plain = json.dumps(table, indent=1, default=lambda array: array.tolist())
    short = re.sub(r"-?\d+\.\d+(e-?\d+)?", lambda m: str(round(float(m[0]), 4)), plain)
    return re.sub(r"\[[^][{}]*\]", lambda m: " ".join(m[0].split()), short) + "\n"


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(as_text(fitted(kitti_pictures())))
