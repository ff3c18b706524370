"""How well a gradient-boosted classifier tells false camera boxes from true ones by all that an
observation shows of them.
"""

import numpy as np
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.metrics import roc_auc_score

from care_sim.core.types import ImageDetections
from care_sim.envs.open_loop import FilmEnv
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.sensors.kitti.invented import TOUCHING
from care_sim.sources.street_films import record
from care_sim.streets.street import make_street
from tests.helpers.kitti_object import PICTURE, TYPES, overlaps

ALL_BUT_FOOT = (1, 2, 3, 4, 6, *range(8, 19))
"""All columns but class, height and lower edge."""
CUT_PX = 369.0
"""Boxes that end lower are cut by KITTI's pictures."""
CAMERA_M, FOCAL_PX = 1.65, 721.5
"""Height of KITTI's camera over the road, and its focal length."""


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


def area_under_the_curve(rows, false, half, left_out=()):
    """Mean over both ways: learned from one `half` (n,) 0 or 1 of the boxes, tested on the other.
    The columns `left_out` are not shown.
    """
    seen = np.delete(visible(rows), left_out, axis=1)
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


def on_a_flat_road(told, rows):
    """Boxes (m, 7) as if KITTI's road were flat and all objects of a type equally high.

    A box that overlaps a label moves and grows with it, another moves as the picture's labels do
    (median).
    """
    flat = rows.copy()
    with np.errstate(divide="ignore"):
        shifts = (told.stand[:, 0] - CAMERA_M) / np.maximum(told.depths, 3.0) * FOCAL_PX
    growth = np.ones(len(shifts))
    for name in TYPES:
        own = told.names == name
        growth[own] = told.stand[own, 1].mean() / told.stand[own, 1]
    measured = np.isin(told.names, list(TYPES))
    for picture in np.unique(rows[:, 6]):
        (own,), (shown,) = (
            np.nonzero(rows[:, 6] == picture),
            np.nonzero(measured & (told.pictures == picture)),
        )
        if not len(shown):
            continue
        union, _ = overlaps(rows[own, 2:6], told.boxes[shown])
        for n, behind in zip(own, shown[union.argmax(axis=1)], strict=True):
            foot = told.boxes[behind, 3]
            moved = foot - shifts[behind] + (rows[n, [3, 5]] - foot) * growth[behind]
            beside = union[own == n].max() >= TOUCHING
            flat[n, [3, 5]] = moved if beside else rows[n, [3, 5]] - np.median(shifts[shown])
    flat[:, [3, 5]] = np.clip(np.trunc(flat[:, [3, 5]]), 0, PICTURE[1])
    cut = rows[:, 5] >= CUT_PX
    flat[cut, 5] = rows[cut, 5]
    return flat


def boxes_of_streets(seeds, episodes, profile="kitti"):
    """All boxes (n, 7) that observations of streets show, which are false, and the street of each
    from 0.
    """
    parts = [_boxes_of_street(seed, episodes, profile) for seed in seeds]
    streets = np.repeat(np.arange(len(parts)), [len(rows) for rows, _ in parts])
    pictures = np.cumsum([0, *(rows[:, 6].max() + 1 for rows, _ in parts)])
    rows = np.concatenate([rows for rows, _ in parts])
    rows[:, 6] += pictures[streets]
    return rows, np.concatenate([false for _, false in parts]), streets


def _boxes_of_street(seed, episodes, profile):
    env = FilmEnv(record(make_street(seed)), budget=0.01, camera_profile=profile)
    rows, false = [], []
    for episode in range(episodes):
        observation, _ = env.reset(seed=episode)
        over = False
        while not over:
            shown = observation["detections"][observation["detections"][:, 0] >= 0].astype(float)
            behind = env.unwrapped.loop.true_detected_objects()
            pictures = shown[:, ImageDetections.CAMERA] + 6 * len(rows)
            rows.append(np.column_stack([shown[:, :6], pictures]))
            false.append(behind == NO_OBJECT)
            observation, _, ended, cut, _ = env.step(np.zeros(env.action_space.shape, np.float32))
            over = ended or cut
    return np.concatenate(rows), np.concatenate(false)
