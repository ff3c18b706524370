"""Drives of KITTI's tracking benchmark (../shared/data): pictures of the object benchmark found in
them again, the profile `kitti` played on their labels, and how long false boxes stay.
"""

from collections import Counter, defaultdict

import numpy as np

from care_sim.core.arrays import ONE_WORLD
from care_sim.sensors.kitti.beside import PAIRS
from care_sim.sensors.kitti.detector import report
from care_sim.sensors.kitti.draws import PersistentNormals, Renewals, key_of
from care_sim.sensors.kitti.invented import MOST, Chance
from tests.helpers.kitti_object import FOLDER, PICTURE, Pictures, as_labels, matched, overlaps

DRIVES = FOLDER.parent / "kitti-tracking" / "training" / "label_02"
NAMES = "0001", "0004", "0008", "0015", "0020"
"""The drives from which the pictures of the object benchmark's validation half are."""
SECONDS = 0.1
BEYOND = np.array([0.0, 0.15, 0.3])
"""Shares beyond the picture of the tracking benchmark's levels of truncation (assumed)."""


def pictures_of_drives():
    """{(drive, frame): number of the picture}, found by places of labels that agree to 0.1 m."""
    frames = defaultdict(list)
    for name in NAMES:
        for line in map(str.split, (DRIVES / f"{name}.txt").read_text().splitlines()):
            if line[2] != "DontCare":
                frames[_place(line[13:16])].append((name, int(line[0])))
    ids = (FOLDER / "val_images.txt").read_text().split()
    shown = defaultdict(list)
    for line in map(str.split, (FOLDER / "val_labels.txt").read_text().splitlines()):
        if line[1] not in ("DontCare", "Misc", "Tram"):
            shown[line[0]].append(_place(line[12:15]))
    found = {}
    for number, one in enumerate(ids):
        votes = Counter(frame for place in shown[one] for frame in frames[place])
        frame, count = (votes.most_common(1) or [(None, 0)])[0]
        if count >= max(1, len(shown[one]) / 2) and count >= min(2, len(shown[one])):
            found[frame] = number
    return found


def _place(words):
    return tuple(round(float(word), 1) for word in words)


def drive_of(name):
    """The labels of a drive as pictures, and (n,) the track of each label."""
    lines = [line.split() for line in (DRIVES / f"{name}.txt").read_text().splitlines()]
    names = np.array([line[2] for line in lines])
    frames, tracks = np.array([line[:2] for line in lines], int).T
    numbers = np.array([line[3:] for line in lines], float)
    beyond, levels = BEYOND[np.clip(numbers[:, 0], 0, 2).astype(int)], np.clip(numbers[:, 1], 0, 3)
    x, z = numbers[:, 10], numbers[:, 12]
    told = np.column_stack([beyond, levels, np.hypot(x, z)])
    boxes, stand, nothing = numbers[:, 3:7], numbers[:, [11, 7]], np.empty((0, 7))
    return Pictures(names, frames, boxes, told, z, stand, nothing, frames.max() + 1), tracks


def played(name, measured, seed):
    """A drive with the boxes (m, 7) that the simulated detector reports of it: class, score, edges,
    frame.
    """
    told, tracks = drive_of(name)
    labels, rows = as_labels(told)
    places = np.unique(tracks[rows], return_inverse=True)[1]
    rng, times, objects = np.random.default_rng(seed), measured.times, places.max() + 1
    luck = PersistentNormals(1, 1, 0.0, times.luck_share, times.luck_s, SECONDS)
    of_edges = times.edges_lasting, times.edges_share, times.edges_s
    edges = PersistentNormals(1, 4, *of_edges, SECONDS)
    beside = Renewals(1, PAIRS * MOST, times.false_s, SECONDS)
    scene = Renewals(1, 3 * MOST, times.false_s, SECONDS)
    for draws, stream in zip((luck, edges, beside, scene), rng.spawn(4), strict=True):
        draws.begin(0, 1 if draws is scene else objects, stream)
    false_key, key = rng.integers(2**63, size=2).astype(np.uint64)
    nothing = np.empty(0, np.int64), np.empty((0, 4)), np.empty(0, np.int64)
    parts = []
    for frame in range(told.count):
        own = labels.cameras == frame
        shown = type(labels)(*(column[own] for column in labels))
        shown = shown._replace(cameras=np.zeros(own.sum(), np.int64), places=places[own])
        now = np.uint64(key_of(key, frame, 0, 0))
        began, scenes = beside.next(ONE_WORLD)[0, :objects], scene.next(ONE_WORLD)[0, :1]
        own_luck = np.ascontiguousarray(luck.next(ONE_WORLD)[0, :objects, 0])
        errors = edges.next(ONE_WORLD)[0, :objects]
        chance = Chance(false_key, now, own_luck, errors, began, scenes)
        made, _ = report(shown, PICTURE[None], nothing, chance, measured.numbers)
        frames = np.full(len(made.scores), frame)
        parts.append(np.column_stack([made.classes, made.scores, np.trunc(made.edges), frames]))
    return told._replace(found=np.concatenate(parts))


def stayed(told, frames, lags, confidence, least_iou=0.3):
    """(lags, 2) how many false boxes overlap one of their class so many frames later, and of how
    many. `frames` {(drive, frame): picture} are those of `told`.
    """
    sure = told.found[told.found[:, 1] >= confidence]
    false = sure[matched(told, sure) == -1]
    shown = {number: false[false[:, 6] == number] for number in frames.values()}
    counts = np.zeros((len(lags), 2), int)
    for (drive, frame), number in frames.items():
        for n, lag in enumerate(lags):
            later = shown.get(frames.get((drive, frame + lag)))
            if later is None:
                continue
            union = overlaps(shown[number][:, 2:6], later[:, 2:6])[0]
            union = union * (shown[number][:, 0][:, None] == later[:, 0])
            counts[n] += (union.max(axis=1, initial=0) >= least_iou).sum(), len(union)
    return counts
