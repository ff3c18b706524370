"""Pictures of KITTI's object benchmark with the boxes of a real 2D detector (../shared/data)."""

from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components

from care_sim.core.types import CLASSES
from care_sim.sensors.kitti.beside import PAIRS
from care_sim.sensors.kitti.detector import report
from care_sim.sensors.kitti.invented import MOST, Chance
from care_sim.sensors.kitti.labels import KINDS, Labels, covered

FOLDER = Path(__file__).parents[3] / "shared" / "data" / "kitti-object"
needs_kitti = pytest.mark.skipif(not FOLDER.is_dir(), reason=f"no {FOLDER}")
PICTURE = np.array([1242.0, 375.0, 609.6, 172.9, 1.0])
TYPES = {"Car": "car", "Pedestrian": "pedestrian", "Cyclist": "bicycle"}
EXCUSES = {"car": ("Van", "Truck"), "pedestrian": ("Person_sitting",), "bicycle": ()}
DETECTED = {1: "pedestrian", 2: "car", 3: "bicycle"}


class Pictures(NamedTuple):
    """`names` (n,) types of all labels, `pictures` (n,) that show them, `boxes` (n, 4), `told`
    (n, 3) truncation, occlusion, planar distance, `depths` (n,), `stand` (n, 2) how far their
    base is below the camera and their height, metres; and `found` (m, 7) boxes of the detector:
    class, score, edges, picture.
    """

    names: np.ndarray
    pictures: np.ndarray
    boxes: np.ndarray
    told: np.ndarray
    depths: np.ndarray
    stand: np.ndarray
    found: np.ndarray
    count: int


@cache
def kitti_pictures():
    ids = {name: n for n, name in enumerate((FOLDER / "val_images.txt").read_text().split())}
    labels = [line.split() for line in (FOLDER / "val_labels.txt").read_text().splitlines()]
    boxes = [line.split() for line in (FOLDER / "val_detections.txt").read_text().splitlines()]
    numbers = np.array([line[2:] for line in labels], float)
    x, z = numbers[:, 10], numbers[:, 12]
    found = [
        [CLASSES.index(DETECTED[int(box[1])]), *map(float, box[2:7]), ids[box[0]]] for box in boxes
    ]
    return Pictures(
        np.array([line[1] for line in labels]),
        np.array([ids[line[0]] for line in labels]),
        numbers[:, 3:7],
        np.column_stack([numbers[:, :2], np.hypot(x, z)]),
        z,
        numbers[:, [11, 7]],
        np.array(found),
        len(ids),
    )


@cache
def halves(seed=None):
    """(count,) the half, 0 or 1, of every picture of `kitti_pictures`, in whole groups: pictures
    that share two labels of one type and size show the same objects. The largest groups go first,
    with a `seed` in any order.
    """
    lines = [line.split() for line in (FOLDER / "val_labels.txt").read_text().splitlines()]
    objects = ["/".join([line[1], *line[9:12]]) for line in lines if line[1] != "DontCare"]
    pictures = kitti_pictures().pictures[kitti_pictures().names != "DontCare"]
    shown = np.zeros((kitti_pictures().count, len(set(objects))), np.float32)
    shown[pictures, np.unique(objects, return_inverse=True)[1]] = 1
    groups = connected_components(shown @ shown.T >= 2)[1]
    sizes = np.bincount(groups)
    rng = np.random.default_rng(seed)
    order = np.argsort(-sizes, kind="stable") if seed is None else rng.permutation(len(sizes))
    half, totals = np.zeros(len(sizes), int), np.zeros(2, int)
    for group in order:
        half[group] = totals.argmin()
        totals[half[group]] += sizes[group]
    return half[groups]


def as_labels(told: Pictures) -> tuple[Labels, np.ndarray]:
    """The labels of the three measured types, and (n,) their rows in `told`."""
    everything = told.names != "DontCare"
    cover = np.zeros(len(told.names))
    cover[everything] = covered(
        told.boxes[everything], told.depths[everything], told.pictures[everything]
    )
    (rows,) = np.nonzero(np.isin(told.names, list(TYPES)))
    classes = np.array([CLASSES.index(TYPES[name]) for name in told.names[rows]])
    boxes, (beyond, levels, metres) = told.boxes[rows], told.told[rows].T
    # Labels end where the picture does; its width differs by a few pixels between drives.
    cut = np.column_stack(
        [
            boxes[:, 0] <= 0.6,
            boxes[:, 1] <= 0.6,
            (boxes[:, 2] >= 1222) & (beyond > 0),
            boxes[:, 3] >= 368.5,
        ]
    )
    labels = Labels(
        classes,
        KINDS[classes],
        boxes,
        cut,
        levels.astype(np.int64),
        beyond,
        np.where(classes == 0, metres, 0.0),
        cover[rows],
        told.pictures[rows],
        np.arange(len(rows)),
    )
    return labels, rows


def simulated(told, numbers, seed):
    """(m, 7) what the simulated detector reports of the pictures: class, score, edges, picture."""
    labels, _ = as_labels(told)
    rng = np.random.default_rng(seed)
    chance = Chance(
        *rng.integers(2**63, size=2).astype(np.uint64),
        rng.standard_normal(len(labels.kinds)),
        rng.standard_normal((len(labels.kinds), 4)),
        np.zeros((len(labels.kinds), PAIRS * MOST), np.int64),
        np.zeros((told.count, 3 * MOST), np.int64),
    )
    nothing = np.empty(0, np.int64), np.empty((0, 4)), np.empty(0, np.int64)
    pictures = np.tile(PICTURE, (told.count, 1))
    boxes, shown_in = report(labels, pictures, nothing, chance, numbers)
    return np.column_stack([boxes.classes, boxes.scores, np.trunc(boxes.edges), shown_in])


def overlaps(ours, theirs):
    """(n, m) intersection over union, and the intersections' shares of `ours`, of boxes (., 4)."""
    low = np.maximum(ours[:, None, :2], theirs[None, :, :2])
    high = np.minimum(ours[:, None, 2:], theirs[None, :, 2:])
    common = np.prod(np.clip(high - low, 0, None), axis=-1)
    own, other = (np.prod(boxes[:, 2:] - boxes[:, :2], axis=1) for boxes in (ours, theirs))
    union = own[:, None] + other - common
    return common / np.maximum(union, 1e-9), common / np.maximum(own[:, None], 1e-9)


def matched(told, found, excused=True):
    """(m,) the label of each box, -1 of false ones, -2 of those that an unmeasured label excuses.

    The surest box first takes the label of its class that it overlaps most, from 0.5.
    """
    behind = np.full(len(found), -1)
    of_class = np.array([TYPES.get(name, "") for name in told.names])
    for picture in range(told.count):
        (own,) = np.nonzero(found[:, 6] == picture)
        (shown,) = np.nonzero(told.pictures == picture)
        if not len(shown):
            continue
        union, share = overlaps(found[own, 2:6], told.boxes[shown])
        free = np.ones(len(shown), bool)
        for n in np.argsort(-found[own, 1], kind="stable"):
            label = CLASSES[int(found[own[n], 0])]
            fits = np.where((of_class[shown] == label) & free, union[n], 0.0)
            if fits.max() >= 0.5:
                behind[own[n]] = shown[fits.argmax()]
                free[fits.argmax()] = False
            elif excused:
                others = np.isin(told.names[shown], EXCUSES[label])
                nobody = told.names[shown] == "DontCare"
                if (union[n][others] >= 0.5).any() or (share[n][nobody] >= 0.5).any():
                    behind[own[n]] = -2
    return behind
