"""A picture's way through the detector: who is found and how sure, errors, false boxes,
suppression, and last whole pixels for all boxes alike.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from care_sim.base.compiled import compiled
from care_sim.base.threads import Threads
from care_sim.core.arrays import Floats, Integers, Mask, longer
from care_sim.core.pinhole import MountedCameras, PinholeCamera
from care_sim.core.rows import copy_row
from care_sim.core.types import ImageDetections
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.sensors.camera_faults import Detected, place_of
from care_sim.sensors.kitti.background import add_lent, add_scene
from care_sim.sensors.kitti.beside import PAIRS, add_beside
from care_sim.sensors.kitti.draws import PersistentNormals, Renewals, key_of
from care_sim.sensors.kitti.errors import (
    TRIES,
    kept,
    lay_erring,
    lay_normals,
    overlaps_any,
    resembles,
    surest_of,
)
from care_sim.sensors.kitti.invented import MOST, Boxes, Chance, Picture
from care_sim.sensors.kitti.labels import Labels, labels_of, pictures_of
from care_sim.sensors.kitti.numbers import FOCAL_PX, Numbers, measured
from care_sim.sensors.kitti.recall import features, score_logits, score_of

EDGES = 4
# Compiled code can only read module-level constants.
_CLASS, _CONFIDENCE = ImageDetections.CLASS, ImageDetections.CONFIDENCE
_LEFT, _CAMERA = ImageDetections.LEFT, ImageDetections.CAMERA


class KittiDetectors:
    """Make of faultless detections in W worlds what the detector reports. Every kind of chance has
    a random stream of its own. Pictures are of so many `cameras`.
    """

    def __init__(self, worlds: int, cameras: int, keyframe_s: float, threads: Threads):
        self._numbers, times = measured()
        self._threads = threads
        self._cameras = cameras
        of_edges = times.edges_lasting, times.edges_share, times.edges_s
        self._edges = PersistentNormals(worlds, EDGES, *of_edges, keyframe_s)
        self._luck = PersistentNormals(worlds, 1, 0.0, times.luck_share, times.luck_s, keyframe_s)
        self._beside, self._scene = (
            Renewals(worlds, states * MOST, times.false_s, keyframe_s)
            for states in (PAIRS, len(self._numbers.pair_scores))
        )
        self._keys = np.zeros((worlds, 2), np.uint64)
        self._keyframes = np.zeros(worlds, np.int64)
        self._pictures = np.zeros((worlds, cameras, 5))

    def begin(
        self,
        world: int,
        objects: int,
        cameras: Sequence[PinholeCamera],
        seeds: Sequence[np.random.SeedSequence],
    ) -> None:
        """Begin an episode with so many objects that may be found. `cameras` are as mounted."""
        streams = *seeds[:2], seeds[3], *seeds[2].spawn(2)
        luck, edges, key, beside, scene = (np.random.default_rng(seed) for seed in streams)
        self._luck.begin(world, objects, luck)
        self._edges.begin(world, objects, edges)
        self._beside.begin(world, objects, beside)
        self._scene.begin(world, self._cameras, scene)
        self._keys[world] = key.integers(2**63, size=2).astype(np.uint64)
        self._keyframes[world] = 0
        self._pictures[world] = pictures_of(cameras)

    def detect(
        self,
        live: Mask,
        seen: Detected,
        false: Integers,
        objects: tuple[Integers, Integers, Floats],
        visible: Floats,
        cameras: MountedCameras,
    ) -> Detected:
        """Return `seen` with the reports on these detections in the worlds that are `live`. The
        last `false` (W,) detections of a world, counted anew, are false: before, those that get
        scores and errors like the others. `objects` are how many a world has (W,),
        their numbers (W, n), and 3D boxes (W, n, 7) in the sensor frames. `visible` (W, D) is as in
        `labels_of`, `cameras` are as mounted. Errors change per keyframe, whatever the time.
        """
        # Everything is drawn at every keyframe, whatever is there.
        self._keyframes += live
        normals = np.ascontiguousarray(self._luck.next(live)[..., 0]), self._edges.next(live)
        begun = self._beside.next(live), self._scene.next(live)
        most = int(seen.counts.max())
        room = most * (1 + PAIRS * MOST) + self._cameras * len(self._numbers.pairs) * MOST
        if room > seen.rows.shape[1]:
            seen = Detected(seen.counts, longer(seen.rows, room), longer(seen.objects, room))
        given = objects, visible, cameras, self._pictures
        drawn = self._keys, self._keyframes, normals, begun
        self._threads.share(_report, live, seen, false, *given, *drawn, self._numbers)
        return seen


@compiled()
def _report(
    live: Mask,
    seen: Detected,
    false: Integers,
    objects: tuple[Integers, Integers, Floats],
    visible: Floats,
    cameras: MountedCameras,
    pictures: Floats,
    keys: NDArray[np.uint64],
    keyframes: Integers,
    normals: tuple[Floats, Floats],
    begun: tuple[Integers, Integers],
    numbers: Numbers,
) -> None:
    """See `KittiDetectors.detect`. `keys` (W, 2) are that of false boxes and that of the episode,
    `keyframes` (W,) count from 1. `normals` and `begun` are the arrays of `Chance`, of W worlds.
    """
    for w in range(len(live)):
        if not live[w]:
            continue
        count, known = seen.counts[w] - false[w], objects[0][w]
        rows, bodies = seen.rows[w, :count].copy(), seen.objects[w, :count].copy()
        places = np.empty(count, np.int64)
        for n in range(count):
            places[n] = max(place_of(bodies[n], objects[1][w, :known]), 0)
        labels = labels_of(rows, places, visible[w], objects[2][w], cameras, w)
        lent = _lent(seen.rows[w, count : seen.counts[w]], cameras.focals)
        now = key_of(keys[w, 1], keyframes[w], 0, 0)
        own = normals[0][w, :known], normals[1][w, :known], begun[0][w, :known]
        chance = Chance(keys[w, 0], now, own[0], own[1], own[2], begun[1][w])
        found, shown_in = report(labels, pictures[w], lent, chance, numbers)

        false[w] = _enter(seen, w, (rows, bodies), found, shown_in, cameras.focals)


@compiled()
def _enter(
    seen: Detected,
    world: int,
    given: tuple[Floats, Integers],
    found: Boxes,
    shown_in: Integers,
    focals: Floats,
) -> int:
    """Write the reports, those on objects first, over the detections of a world, which were
    `given`. Return how many are false.
    """
    count = 0
    for is_false in (False, True):
        true = count
        for n in range(len(shown_in)):
            source, camera = found.sources[n], shown_in[n]
            if is_false != (source < 0):
                continue
            row = seen.rows[world, count]
            for k in range(len(row)):
                row[k] = 0.0 if is_false else given[0][source, k]
            row[_CLASS], row[_CONFIDENCE], row[_CAMERA] = found.classes[n], found.scores[n], camera
            # One pixel of KITTI is the unit of all edges.
            for j in range(EDGES):
                row[_LEFT + j] = np.trunc(found.edges[n, j]) / (FOCAL_PX / focals[camera])
            seen.objects[world, count] = NO_OBJECT if is_false else given[1][source]
            count += 1
    seen.counts[world] = count
    return count - true


@compiled()
def _lent(rows: Floats, focals: Floats) -> tuple[Integers, Floats, Integers]:
    """Classes, edges and pictures of false boxes (l, 9), in pixels of KITTI."""
    classes, cameras = np.empty((2, len(rows)), np.int64)
    edges = np.empty((len(rows), EDGES))
    for n in range(len(rows)):
        classes[n], cameras[n] = int(rows[n, _CLASS]), int(rows[n, _CAMERA])
        for j in range(EDGES):
            edges[n, j] = rows[n, _LEFT + j] * (FOCAL_PX / focals[cameras[n]])
    return classes, edges, cameras


@compiled()
def report(
    labels: Labels,
    pictures: Floats,
    lent: tuple[Integers, Floats, Integers],
    chance: Chance,
    numbers: Numbers,
) -> tuple[Boxes, Integers]:
    """The boxes of all pictures (p, 5), not rounded yet, and the picture of each.

    `lent` are classes (l,), edges (l, 4) and pictures (l,) of further false boxes.
    """
    pairs = len(numbers.pairs) * MOST
    most = len(labels.kinds) * (1 + PAIRS * MOST) + len(pictures) * pairs + len(lent[0])
    all_boxes = Boxes(
        np.empty(most, np.int64), np.empty(most), np.empty((most, 4)), np.empty(most, np.int64)
    )
    shown_in = np.empty(most, np.int64)
    scores = _scores(labels, chance.luck, numbers)
    count = 0
    for number in range(len(pictures)):
        (own,) = np.nonzero(labels.cameras == number)
        into = _part(all_boxes, count, most)
        shown = Picture(labels, own, number, pictures[number], numbers, into)
        added = _add_picture(shown, scores, lent, chance)
        shown_in[count : count + added] = number
        count += added
    return _part(all_boxes, 0, count), shown_in[:count]


@compiled()
def _part(boxes: Boxes, first: int, end: int) -> Boxes:
    classes, scores, edges, sources = boxes
    return Boxes(classes[first:end], scores[first:end], edges[first:end], sources[first:end])


@compiled()
def _scores(labels: Labels, luck: Floats, numbers: Numbers) -> Floats:
    """(n,) scores of the objects, 0 of those that are missed."""
    scores = np.zeros(len(labels.kinds))
    for i in range(len(scores)):
        kind, box = labels.kinds[i], labels.boxes[i]
        # The picture may show nothing of an object's own box.
        size = max(box[3] - box[1], 1.0), max(box[2] - box[0], 1.0)
        seen = features(
            kind,
            size[0],
            size[1],
            labels.levels[i],
            labels.beyond[i],
            labels.metres[i],
            labels.cover[i],
            numbers.knots[kind],
        )
        share = 0.5 * math.erfc(-luck[labels.places[i]] / math.sqrt(2.0))
        share = min(max(share, 1e-12), 1 - 1e-12)
        logits = score_logits(numbers.recall[kind], seen)
        score = score_of(math.log(share / (1 - share)), logits, numbers.thresholds)
        scores[i] = score if score >= numbers.least_score else 0.0
    return scores


@compiled()
def _add_picture(
    shown: Picture, scores: Floats, lent: tuple[Integers, Floats, Integers], chance: Chance
) -> int:
    """Enter the boxes of a picture; return how many."""
    into, numbers = shown.into, shown.numbers
    reported = scores, np.empty((len(scores), EDGES))
    count = _add_found(shown, reported, chance)
    count = add_beside(shown, reported, chance, count)
    count = add_scene(shown, chance, count)
    count = add_lent(shown, lent, chance.now, count)
    stays = kept(
        into.edges[:count],
        into.scores[:count],
        into.classes[:count],
        into.sources[:count],
        numbers.suppression_iou,
    )
    return _pack(into, stays)


@compiled()
def _add_found(shown: Picture, reported: tuple[Floats, Floats], chance: Chance) -> int:
    """Enter the found objects' boxes after errors, the surest first; return how many. Fill
    `reported[1]` (n, 4) with them, and with the labels' boxes of missed objects.
    """
    into, labels, (scores, erring) = shown.into, shown.labels, reported
    count = 0
    for place in surest_of(scores[shown.own]):
        i = shown.own[place]
        copy_row(labels.boxes[i], erring[i])
        if scores[i] > 0:
            _lay_own(shown, i, scores[i], count, chance, erring[i])
            into.classes[count], into.scores[count] = labels.classes[i], scores[i]
            into.sources[count] = i
            copy_row(erring[i], into.edges[count])
            count += 1
    return count


@compiled()
def _lay_own(
    shown: Picture, i: int, score: float, surer: int, chance: Chance, into: Floats
) -> None:
    """Let an object's box `into` (4,) err. Errors are drawn again while the box would not count as
    the object's, or one of the `surer` boxes of its class that are entered suppresses it.
    """
    labels, numbers, entered = shown.labels, shown.numbers, shown.into
    place, label = labels.places[i], labels.boxes[i]
    seen_as = labels.kinds[i], labels.levels[i], score
    key = key_of(chance.now, place, 1, 0)
    normals, trial = np.empty(EDGES), np.empty(EDGES)
    copy_row(chance.edges[place], normals)
    has_one, most = False, numbers.suppression_iou
    for t in range(TRIES):
        if t:
            lay_normals(key, EDGES * t, normals)
        lay_erring(label, seen_as, labels.cut[i], normals, shown.frame, numbers, trial)
        if not resembles(trial, label):
            continue
        covered = overlaps_any(
            trial, labels.classes[i], entered.edges, entered.classes, surer, most
        )
        if not (covered and has_one):
            copy_row(trial, into)
        has_one = True
        if not covered:
            return


@compiled()
def _pack(boxes: Boxes, stays: Mask) -> int:
    """Move the rows that stay to the front; return how many."""
    count = 0
    for n in range(len(stays)):
        if stays[n]:
            boxes.classes[count], boxes.scores[count] = boxes.classes[n], boxes.scores[n]
            boxes.sources[count] = boxes.sources[n]
            copy_row(boxes.edges[n], boxes.edges[count])
            count += 1
    return count
