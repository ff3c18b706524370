"""Errors of a measured camera detector (`care_sim.sensors.camera_profiles`): misses, box jitter,
confused classes, ghosts, and how long an error lasts.

Detection depends on an object's height in the picture and its visible share. The height is that of
the object's whole projected 3D box, hidden or not, cut at the picture's edges. The visible share
compares two areas: the box round the visible pixels, and the same box when nothing hides the
object, a share of the whole box (`UNHIDDEN`). CityPersons also defines visibility by boxes (Zhang
et al. 2017). A source that annotates the share itself, as nuScenes does in levels, overrides this.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from care_sim.base.times import LAST_BITS_S
from care_sim.core.arrays import Floats, Integers
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.types import CLASSES, ImageDetections
from care_sim.sensors.annotated import IdentifiedDetections
from care_sim.sensors.camera_profiles import CameraProfile
from care_sim.sensors.false_boxes import NO_ROWS, BoxPool, box_areas, without_duplicates


class PersistentDraws:
    """Random numbers (n, k) from 0 to 1, k per object, uniform at every keyframe. From one keyframe
    to the next each number stays with the chance exp(-keyframe / time); otherwise it is drawn anew.
    So any function of one number alone has the autocorrelation exp(-t / time). Every number takes
    two draws per keyframe, seen or not, so that every policy meets the same.
    """

    def __init__(
        self,
        objects: int,
        times_s: ArrayLike,
        keyframe_s: float,
        rng: np.random.Generator,
    ):
        """`times_s` (k,) are the correlation times in seconds."""
        self._stays = np.exp(-keyframe_s / np.asarray(times_s, float))
        self._rng = rng
        self._numbers = rng.random((objects, len(self._stays)))
        self._started = False

    def next(self) -> Floats:
        """Return (n, k) the numbers of the next keyframe. Do not write to them."""
        if self._started:
            stays, fresh = self._rng.random((2, *self._numbers.shape))
            self._numbers = np.where(stays < self._stays, self._numbers, fresh)
        self._started = True
        return self._numbers


UNHIDDEN = {"car": 0.98, "truck": 0.99, "bus": 1.0, "bicycle": 0.80, "pedestrian": 0.84}
"""Share of an unhidden object's whole box that the box round its pixels fills. Medians of the
catalogue's bodies, seen from all sides at 10 to 30 m. The corners of a turned box stay empty, most
for slender bodies.
"""
_UNHIDDEN = np.array([UNHIDDEN[name] for name in CLASSES])


def seen_as(
    seen: IdentifiedDetections, boxes: Floats, cameras: Sequence[PinholeCamera], focal_px: float
) -> tuple[Floats, Floats]:
    """Return (n,) heights and (n,) visible shares of the detections `seen`. Heights are in pixels
    of a picture of the focal length `focal_px`. `boxes` (n, 7) are the objects' boxes in the sensor
    frame.
    """
    heights = np.empty(len(seen))
    shares = np.empty(len(seen))
    for number, camera in enumerate(cameras):
        (own,) = np.nonzero(seen.detections.cameras == number)
        whole = whole_boxes(camera, boxes[own])
        heights[own] = (whole[:, 3] - whole[:, 1]) * focal_px / camera.focal
        shares[own] = _shares(seen.detections, own, whole)
    return heights, shares if seen.visible is None else seen.visible


def whole_boxes(camera: PinholeCamera, boxes: Floats) -> Floats:
    """Return (n, 4) the image boxes of whole 3D boxes (n, 7), cut at the picture's edges."""
    limits = np.tile([camera.width, camera.height], 2)
    # A box wholly behind the camera spans nothing.
    return np.clip(np.nan_to_num(camera.project_boxes(boxes), nan=0.0), 0.0, limits)


def _shares(detections: ImageDetections, rows: Integers, whole: Floats) -> Floats:
    unhidden = box_areas(whole) * _UNHIDDEN[detections.classes[rows]]
    # Many an object shows more than the median of its kind. No box is smaller than a pixel.
    shares: Floats = np.minimum(box_areas(detections.boxes[rows]) / np.maximum(unhidden, 1.0), 1.0)
    return shares


LEAST_PX = 1.0
"""Width and height that a box keeps within its picture."""


def jitter_boxes(
    boxes: Floats,
    draws: Floats,
    spreads: Floats,
    of_cameras: Integers,
    cameras: Sequence[PinholeCamera],
) -> Floats:
    """Return (n, 4) image `boxes` after Gaussian errors, cut at the edges of their pictures.
    `spreads` (n, 4) are relative to the box: of its middle across and down, and of the logarithms
    of its width and height. `draws` (n, 4) from 0 to 1 set the errors; 0.5 means none. `of_cameras`
    (n,) are places in `cameras`.
    """
    from scipy.special import ndtri

    across, down, wider, higher = (ndtri(draws) * spreads).T
    sizes = boxes[:, 2:] - boxes[:, :2]
    middles = (boxes[:, :2] + boxes[:, 2:]) / 2 + sizes * np.column_stack([across, down])
    half = sizes * np.exp(np.column_stack([wider, higher])) / 2
    # A part of a box at the edge stays in the picture: it was seen there.
    pictures = np.array([(camera.width, camera.height) for camera in cameras], float)
    limits = pictures.reshape(-1, 2)[of_cameras]
    low = np.clip(middles - half, 0.0, limits - LEAST_PX)
    high = np.clip(middles + half, low + LEAST_PX, limits)
    return np.concatenate([low, high], axis=1)


def confuse_classes(classes: Integers, draws: Floats, matrix: Floats) -> Integers:
    """Return (n,) the classes reported for objects of `classes` (n,). `matrix` (c, c) holds the
    chances that the class of a row is reported as the class of a column. `draws` (n,) from 0 to 1
    decide.
    """
    # The reported class is the first whose chance, with those before it, is beyond the draw. The
    # last sum is 1 but for its last bits.
    sums = np.cumsum(matrix, axis=1)[classes]
    reported: Integers = np.minimum((draws[:, None] >= sums).sum(axis=1), matrix.shape[1] - 1)
    return reported


@dataclass(frozen=True)
class _Ghost:
    """A false box that follows the pool's `object` in the pictures of its `camera`. These pictures
    were taken `later_s` seconds after the current ones. `draws` (3,) vary its boxes.
    """

    object: int
    camera: int
    later_s: float
    draws: Floats


class Ghosts:
    """False boxes that are born, follow an object of the pool, and end. The mean number per picture
    is `rate`, the mean life `time_s` seconds. Lives are exponentially distributed, and end when the
    pool's object leaves its pictures. A ghost starts as one of the boxes that are usable then,
    slightly varied, and shows what happened to that object later. So it moves like an object that
    the car passes. A ghost on another box of its class is not shown, since detectors suppress
    duplicates. Draws do not depend on the scene: every policy meets the same ghosts.
    """

    def __init__(
        self,
        pool: BoxPool,
        rate: float,
        time_s: float,
        keyframe_s: float,
        cameras: int,
        rng: np.random.Generator,
    ):
        self._pool = pool
        self._mean = rate * cameras
        self._stays = float(np.exp(-keyframe_s / time_s))
        self._rng = rng
        self._alive: list[_Ghost] = []
        self._started = False

    def draw(self, shown: Floats, time_s: float) -> Floats:
        """Return (k, 9) the ghosts of this keyframe, given the boxes `shown` (n, 9)."""
        stay = self._rng.random(len(self._alive)) < self._stays
        self._alive = [one for one, stays in zip(self._alive, stay, strict=True) if stays]
        # As many are born as end on the mean. The first picture has those of the long run.
        born = self._rng.poisson(self._mean * (1 - self._stays if self._started else 1.0))
        self._started = True
        self._alive += self._born(self._rng.random((born, 4)), time_s)

        # One whose object is out of the pool's picture has ended too.
        rows = [self._row(one, time_s) for one in self._alive]
        self._alive = [one for one, row in zip(self._alive, rows, strict=True) if row is not None]
        if not self._alive:
            return NO_ROWS
        places = np.array([row for row in rows if row is not None], np.int64)
        varied = self._pool.varied(places, np.array([one.draws for one in self._alive]))
        return without_duplicates(varied[:, None], shown)

    def _born(self, draws: Floats, time_s: float) -> list[_Ghost]:
        """Make a ghost for every row of `draws` (k, 4): one picks its box, three vary it."""
        pool = self._pool
        usable = pool.usable(time_s)
        if not len(usable):
            return []
        picks: Integers = usable[(draws[:, 0] * len(usable)).astype(np.int64)]
        return [
            _Ghost(
                int(pool.objects[row]),
                int(pool.cameras[row]),
                float(pool.times_s[row]) - time_s,
                own,
            )
            for row, own in zip(picks.tolist(), draws[:, 1:], strict=True)
        ]

    def _row(self, ghost: _Ghost, time_s: float) -> int | None:
        """Return the pool's box that a ghost shows now, None if it has ended."""
        pool = self._pool
        is_now = np.abs(pool.times_s - time_s - ghost.later_s) <= LAST_BITS_S
        is_own = (pool.objects == ghost.object) & (pool.cameras == ghost.camera)
        rows = np.flatnonzero(is_now & is_own)
        return int(rows[0]) if len(rows) else None


_JITTERED = 4
"""A box's middle across and down, its width and its height."""


class ProfiledDetector:
    """Turns faultless detections into the reports of a profiled detector. `objects` (n,) are all
    objects that it may ever detect, `cameras` those that take the pictures. Ghosts are drawn from
    `pool`. Every kind of error has its own random stream.
    """

    def __init__(
        self,
        profile: CameraProfile,
        objects: Integers,
        cameras: Sequence[PinholeCamera],
        keyframe_s: float,
        pool: BoxPool,
        seeds: Sequence[np.random.SeedSequence],
    ):
        misses, jitter, confusion, ghosts = (np.random.default_rng(seed) for seed in seeds)
        self._profile = profile
        self._objects = objects
        self._order = np.argsort(objects)
        self._cameras = cameras
        self._matrix = profile.confusion_matrix()
        self._spreads = np.array([group.jitter for group in profile.groups])
        # A number for every group: no class need be known of an object before it is seen.
        times_s = [group.miss_time_s for group in profile.groups]
        self._misses = PersistentDraws(len(objects), times_s, keyframe_s, misses)
        jitter_times_s = [profile.jitter_time_s] * _JITTERED
        self._jitter = PersistentDraws(len(objects), jitter_times_s, keyframe_s, jitter)
        self._confusion = PersistentDraws(
            len(objects), [profile.confusion_time_s], keyframe_s, confusion
        )
        self._ghosts = Ghosts(
            pool,
            profile.ghosts_per_picture,
            profile.ghost_time_s,
            keyframe_s,
            len(cameras),
            ghosts,
        )

    def detect(
        self, seen: IdentifiedDetections, boxes: Floats, false: Floats, time_s: float
    ) -> tuple[Floats, Integers, Floats]:
        """Return the reported boxes of the faultless detections `seen` (m,). Returns rows (k, 9) as
        `ImageDetections.rows`, (k,) the object behind each, and rows (j, 9) of false boxes. `boxes`
        (n, 7) are the 3D boxes of all objects in the sensor frame. `false` (l, 9) are false boxes
        that no ghost may overlap.
        """
        ghosts = self._ghosts.draw(np.concatenate([seen.detections.rows(), false]), time_s)
        return *self._report(seen, boxes), np.concatenate([false, ghosts])

    def _report(self, seen: IdentifiedDetections, boxes: Floats) -> tuple[Floats, Integers]:
        # Places of the detections' objects among all objects.
        places = self._order[np.searchsorted(self._objects, seen.objects, sorter=self._order)]
        # All numbers are drawn at every keyframe, whatever is there.
        misses, jitter, confusion = (
            draws.next()[places] for draws in (self._misses, self._jitter, self._confusion)
        )
        classes = seen.detections.classes
        groups = self._profile.groups_of(classes)
        own_misses = misses[np.arange(len(seen)), groups]
        (found,) = np.nonzero(own_misses < self._recalls(seen, groups, boxes[places]))

        rows = seen.detections.rows()[found]
        rows[:, ImageDetections.CLASS] = confuse_classes(
            classes[found], confusion[found, 0], self._matrix
        )
        rows[:, ImageDetections.BOX] = jitter_boxes(
            rows[:, ImageDetections.BOX],
            jitter[found],
            self._spreads[groups[found]],
            seen.detections.cameras[found],
            self._cameras,
        )
        return rows, seen.objects[found]

    def _recalls(self, seen: IdentifiedDetections, groups: Integers, boxes: Floats) -> Floats:
        """Return (m,) recalls of the objects `seen` (m,) of `groups` (m,) with `boxes` (m, 7)."""
        heights, shares = seen_as(seen, boxes, self._cameras, self._profile.focal_px)
        recalls = np.empty(len(seen))
        for number, group in enumerate(self._profile.groups):
            own = groups == number
            recalls[own] = group.recall.at(heights[own], shares[own])
        return recalls
