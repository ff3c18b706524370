"""The limits of observations: the bounds of their numbers, and the rows that their tables keep.

Both loops use them. A bound is the most that the sensors can measure. Numbers beyond are mended,
column by column, before a policy or the controller reads them:

| columns | bound | beyond it |
|---|---|---|
| ego speed, acceleration | 100 m/s, 100 m/s^2; the speed has a sign: below 0 backwards | clipped |
| ego yaw rate | two turns per second | clipped |
| image box | its own camera's picture | clipped; left out if wholly outside |
| age | an hour | clipped |
| yaw, yaw change | two turns | brought back by whole turns: the direction stays |
| x, y, z | 100 m, twice the reach; further off, a track is a guess | shortened: the bearing stays |
| vx, vy | 100 m/s; more is a track that changed its object | shortened: the heading stays |
| length, width, height | 50 m | clipped |
| ids and counts | 2^24: float32 holds all whole numbers up to it | clipped |

The tables have `MAX_DETECTIONS` and `MAX_TRACKS` rows. If there are more detections, the first
stay: the camera gives the surest first. If there are more tracks, the nearest forecast that
explains a detection stays for every detection, so that Eq. 2 has the same answers as with all
tracks. The nearest of the others fill the table. The order stays: nearest first.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.belief import HIGHEST, MAX_DETECTIONS, MAX_TRACKS, Belief, rows_within
from care_sim.core.residual import explaining_tracks
from care_sim.core.rig import Rig
from care_sim.core.types import CLASSES, Ego, ImageDetections, Tracks

MAX_SPEED_MPS = 100.0
MAX_ACCELERATION_MPS2 = 100.0
MAX_AGE_S = 3600.0
MAX_SIZE_M = 50.0
MAX_TURN = 4 * np.pi

_EGO = (MAX_SPEED_MPS, MAX_TURN, MAX_ACCELERATION_MPS2)


@dataclass(frozen=True)
class Limits:
    """The bounds of a rig's observations, as tables of two rows, least and most: `ego` (2, 3),
    `detections` (2, 9) and `tracks` (2, 13), columns as in `care_sim.core.types`.
    """

    rig: Rig

    @cached_property
    def ego(self) -> Floats:
        """Bounds of speed, yaw rate and acceleration."""
        return np.array([np.negative(_EGO), _EGO])

    @cached_property
    def detections(self) -> Floats:
        """Bounds of `ImageDetections.COLUMNS`, over all cameras; class -1 pads."""
        least, most = self.pictured
        return np.stack([np.r_[-1.0, least[1:]], most.max(axis=0)])

    @cached_property
    def tracks(self) -> Floats:
        """Bounds of `Tracks.COLUMNS`; id -1 pads."""
        far = 2 * self.rig.grid.range_m
        classes = len(CLASSES) - 1
        counts = [HIGHEST, HIGHEST]
        moving = [MAX_TURN, MAX_SPEED_MPS, MAX_SPEED_MPS]
        most = np.array([HIGHEST, classes, *[far] * 3, *[MAX_SIZE_M] * 3, *moving, *counts])
        least = np.array([-1, 0, *[-far] * 3, *[0] * 3, *np.negative(moving), 0, 0])
        return np.stack([least, most])

    def belief(
        self, ego: Ego, detections: ImageDetections, tracks: Tracks, ranges: np.ndarray
    ) -> Belief:
        """Return the belief of a keyframe, within the limits. `tracks` come nearest first, `ranges`
        (E, A) lie between 0 and the reach.
        """
        detections = self._limited_detections(detections)
        tracks = self._fitting(self._limited_tracks(tracks), detections)
        return Belief(self._limited_ego(ego), self.rig.budget, detections, tracks, ranges)

    def kept_detections(self, detections: ImageDetections) -> Integers:
        """(k,) the rows of `detections` that a belief shows, in its order: those that lie in the
        picture, and no more than the table holds.
        """
        return np.arange(len(detections)) if self._fit(detections) else self._shown(detections)

    def _fit(self, detections: ImageDetections) -> bool:
        """Whether nothing of the detections lies beyond the limits, so that all are shown."""
        least, most = self.pictured
        rows = detections.rows()
        return len(rows) <= MAX_DETECTIONS and rows_within(rows, least, most[detections.cameras])

    def _shown(self, detections: ImageDetections) -> Integers:
        """The rows of those that lie in the picture, and no more than the table holds."""
        # Looked at before clipping, which would leave of a box wholly outside a line on the edge.
        left, top, right, bottom = detections.boxes.T
        width, height = self.pictured[1][detections.cameras, ImageDetections.BOX][:, 2:].T
        shown = (left < width) & (top < height) & (right > 0) & (bottom > 0)
        return np.flatnonzero(shown)[:MAX_DETECTIONS]

    def _limited_ego(self, ego: Ego) -> Ego:
        values = np.array([ego.speed, ego.yaw_rate, ego.acceleration])
        return ego if (np.abs(values) <= _EGO).all() else Ego(*np.clip(values, *self.ego).tolist())

    @cached_property
    def pictured(self) -> tuple[Floats, Floats]:
        """The least (9,) and for every camera the most (k, 9) of a detection."""
        cameras = self.rig.cameras
        last = max(len(cameras) - 1, 1)
        edges = [[camera.width, camera.height] * 2 for camera in cameras]
        most = np.array([[len(CLASSES) - 1, 1, *edge, last, MAX_AGE_S, MAX_TURN] for edge in edges])
        return np.array([0, 0, *[0] * 4, 0, 0, -MAX_TURN]), most

    def _limited_detections(self, detections: ImageDetections) -> ImageDetections:
        # Detections within the limits are returned as they are.
        if self._fit(detections):
            return detections
        least, most = self.pictured
        rows = detections.rows().copy()
        yaw_change = ImageDetections.YAW_CHANGE
        rows[:, yaw_change] = _without_turns(rows[:, yaw_change])
        within = np.clip(rows, least, most[detections.cameras])
        return ImageDetections.from_rows(within[self._shown(detections)])

    def _limited_tracks(self, tracks: Tracks) -> Tracks:
        rows = tracks.rows()
        least, most = self.tracks
        if rows_within(rows, least, most[None]):
            return tracks

        # Directions are kept first. Clipping alone would turn a bearing, a velocity and a heading.
        rows = rows.copy()
        rows[:, Tracks.YAW] = _without_turns(rows[:, Tracks.YAW])
        for columns in (Tracks.CENTRE, Tracks.VELOCITY):
            rows[:, columns] = _shortened(rows[:, columns], most[columns.start])
        return Tracks.from_rows(np.clip(rows, least, most))

    def _fitting(self, tracks: Tracks, detections: ImageDetections) -> Tracks:
        """As many of the tracks as the table holds; see above which."""
        if len(tracks) <= MAX_TRACKS:
            return tracks
        # A centre on the edge of a box may move across it in float32, so the matching is that of
        # what will be shown.
        shown = Tracks.from_rows(tracks.rows().astype(np.float32))
        seen = ImageDetections.from_rows(detections.rows().astype(np.float32))
        first = explaining_tracks(seen, shown, self.rig)
        # Tracks that explain something come first; a stable sort leaves both kinds nearest first.
        order = np.ones(len(tracks), np.int64)
        order[first[first >= 0]] = 0
        return tracks.take(np.sort(np.argsort(order, kind="stable")[:MAX_TRACKS]))


def _without_turns(angles: Floats) -> Floats:
    """Angles beyond `MAX_TURN`, less whole turns; the others as they are."""
    return np.where(np.abs(angles) > MAX_TURN, np.remainder(angles, 2 * np.pi), angles)


def _shortened(vectors: Floats, most: float) -> Floats:
    """Vectors (n, k) whose components reach beyond `most`, in their direction; the others as they
    are.
    """
    # At least `most`, so that the factor is 1 for whatever does not reach beyond it.
    longest = np.abs(vectors).max(axis=1, initial=most)
    return np.asarray(vectors * (most / longest)[:, None])
