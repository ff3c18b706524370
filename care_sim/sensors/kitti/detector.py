"""A picture's way through the detector: who is found and how sure, errors, false boxes,
suppression, and last whole pixels for all boxes alike.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.types import ImageDetections
from care_sim.sensors.annotated import IdentifiedDetections
from care_sim.sensors.kitti.background import add_lent, add_scene
from care_sim.sensors.kitti.beside import PAIRS, add_beside
from care_sim.sensors.kitti.draws import PersistentNormals, Renewals, key_of
from care_sim.sensors.kitti.errors import (
    TRIES,
    copy_box,
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


class Draws(NamedTuple):
    """Draws of a keyframe: (objects,) luck as normal numbers, (objects, 4) errors of edges, a key,
    and the chance of false boxes.
    """

    luck: Floats
    edges: Floats
    key: np.uint64
    false: Chance


class KittiDetector:
    """Makes of faultless detections what the detector reports.

    `objects` (n,) are all that it may ever find, `cameras` those that take the pictures. Every kind
    of chance has a random stream of its own.
    """

    def __init__(
        self,
        objects: Integers,
        cameras: Sequence[PinholeCamera],
        keyframe_s: float,
        seeds: Sequence[np.random.SeedSequence],
    ):
        streams = *seeds[:2], seeds[3], *seeds[2].spawn(2)
        luck, edges, key, beside, scene = (np.random.default_rng(seed) for seed in streams)
        self._numbers, times = measured()
        self._objects = objects
        self._order = np.argsort(objects)
        self._cameras = cameras
        self._pictures = pictures_of(cameras, FOCAL_PX)
        self._luck = PersistentNormals(
            len(objects), [0.0], [times.luck_share], [times.luck_s], keyframe_s, luck
        )
        self._edges = PersistentNormals(
            len(objects),
            [times.edges_lasting] * EDGES,
            [times.edges_share] * EDGES,
            [times.edges_s] * EDGES,
            keyframe_s,
            edges,
        )
        shapes = (len(objects), PAIRS * MOST), (len(cameras), len(self._numbers.pair_scores) * MOST)
        self._beside, self._scene = (
            Renewals(shape, times.false_s, keyframe_s, rng)
            for shape, rng in zip(shapes, (beside, scene), strict=True)
        )
        self._false_key, self._key = key.integers(2**63, size=2).astype(np.uint64)
        self._keyframe = 0

    def detect(
        self, seen: IdentifiedDetections, boxes: Floats, lent: Floats, time_s: float
    ) -> tuple[Floats, Integers, Floats]:
        """Return the reports on the faultless detections `seen` (m,). Returns rows (k, 9) as
        `ImageDetections.rows`, (k,) the object behind each, and rows (j, 9) of false boxes. `boxes`
        (n, 7) are the 3D boxes of all objects in the sensor frame. `lent` (l, 9) are further false
        boxes, which get scores and errors like the others. Errors change per keyframe, whatever the
        time.
        """
        # Everything is drawn at every keyframe, whatever is there.
        self._keyframe += 1
        luck, edges = self._luck.next()[:, 0], self._edges.next()
        key = np.uint64(key_of(self._key, self._keyframe, 0, 0))
        false = Chance(self._false_key, key, self._beside.next(), self._scene.next())
        draws = Draws(luck, edges, key, false)

        places = self._order[np.searchsorted(self._objects, seen.objects, sorter=self._order)]
        labels = labels_of(seen, boxes[places], places, self._cameras, FOCAL_PX)
        scales = np.array([FOCAL_PX / camera.focal for camera in self._cameras])
        cameras = lent[:, ImageDetections.CAMERA].astype(np.int64)
        edges_lent = lent[:, ImageDetections.BOX] * scales[cameras][:, None]
        others = lent[:, ImageDetections.CLASS].astype(np.int64), edges_lent, cameras
        found, shown_in = report(labels, self._pictures, others, draws, self._numbers)

        # One pixel of KITTI is the unit of all edges.
        rows = np.zeros((len(shown_in), len(ImageDetections.COLUMNS)))
        real = found.sources >= 0
        rows[real] = seen.detections.rows()[found.sources[real]]
        rows[:, ImageDetections.CLASS] = found.classes
        rows[:, ImageDetections.CONFIDENCE] = found.scores
        rows[:, ImageDetections.BOX] = np.trunc(found.edges) / scales[shown_in][:, None]
        rows[:, ImageDetections.CAMERA] = shown_in
        return rows[real], seen.objects[found.sources[real]], rows[~real]


@compiled()
def report(
    labels: Labels,
    pictures: Floats,
    lent: tuple[Integers, Floats, Integers],
    draws: Draws,
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
    scores = _scores(labels, draws.luck, numbers)
    count = 0
    for number in range(len(pictures)):
        (own,) = np.nonzero(labels.cameras == number)
        into = _part(all_boxes, count, most)
        shown = Picture(labels, own, number, pictures[number], numbers, into)
        added = _add_picture(shown, scores, lent, draws)
        for n in range(count, count + added):
            shown_in[n] = number
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
    shown: Picture, scores: Floats, lent: tuple[Integers, Floats, Integers], draws: Draws
) -> int:
    """Enter the boxes of a picture; return how many."""
    into, numbers = shown.into, shown.numbers
    reported = scores, np.empty((len(scores), EDGES))
    count = _add_found(shown, reported, draws)
    count = add_beside(shown, reported, draws.false, count)
    count = add_scene(shown, draws.false, count)
    count = add_lent(shown, lent, draws.key, count)
    stays = kept(
        into.edges[:count],
        into.scores[:count],
        into.classes[:count],
        into.sources[:count],
        numbers.suppression_iou,
    )
    return _pack(into, stays)


@compiled()
def _add_found(shown: Picture, reported: tuple[Floats, Floats], draws: Draws) -> int:
    """Enter the found objects' boxes after errors, the surest first; return how many. Fill
    `reported[1]` (n, 4) with them, and with the labels' boxes of missed objects.
    """
    into, labels, (scores, erring) = shown.into, shown.labels, reported
    count = 0
    for place in surest_of(scores[shown.own]):
        i = shown.own[place]
        copy_box(labels.boxes[i], erring[i])
        if scores[i] > 0:
            _lay_own(shown, i, scores[i], count, draws, erring[i])
            into.classes[count], into.scores[count] = labels.classes[i], scores[i]
            into.sources[count] = i
            copy_box(erring[i], into.edges[count])
            count += 1
    return count


@compiled()
def _lay_own(shown: Picture, i: int, score: float, surer: int, draws: Draws, into: Floats) -> None:
    """Let an object's box `into` (4,) err. Errors are drawn again while the box would not count as
    the object's, or one of the `surer` boxes of its class that are entered suppresses it.
    """
    labels, numbers, entered = shown.labels, shown.numbers, shown.into
    place, label = labels.places[i], labels.boxes[i]
    seen_as = labels.kinds[i], labels.levels[i], score
    key = key_of(draws.key, place, 1, 0)
    normals, trial = np.empty(EDGES), np.empty(EDGES)
    copy_box(draws.edges[place], normals)
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
            copy_box(trial, into)
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
            copy_box(boxes.edges[n], boxes.edges[count])
            count += 1
    return count
