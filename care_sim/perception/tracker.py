"""Track memory: assignment by position, velocity from two keyframes, coasting, forecasts."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from care_sim.base.times import LAST_BITS_S
from care_sim.core.arrays import Floats, Integers
from care_sim.core.frames import Frame, turned
from care_sim.core.types import Detections, Tracks

_EMPTY = Tracks.from_rows(np.empty((0, len(Tracks.COLUMNS))))
_IMPOSSIBLE_M = 1e6
"""The cost of a pair that cannot be one object, in metres of distance: more than all others."""


@dataclass(frozen=True)
class MemoryRules:
    """Association and life of a track."""

    gate_m: float = 2.0
    """A detection further from a forecast is another object (the paper's match distance)."""
    first_speed_mps: float = 15.0
    """A track seen once has no velocity: its gate grows by this much per second (54 km/h)."""
    coast_s: float = 1.5
    """An undetected track is forecast this long, then dropped: for 15 keyframes of the closed loop,
    for 3 of the open one (CenterPoint's tracker: 3 frames at 2 Hz).
    """


class TrackMemory:
    """The tracks of an episode.

    They are kept in the world frame, so that the ego's motion is compensated, and are given and
    taken in the sensor frame.
    """

    def __init__(self, keyframe_s: float, rules: MemoryRules = MemoryRules()):
        self._keyframe_s = keyframe_s
        self._rules = rules
        self._tracks = _EMPTY
        self._next_id = 0

    def tracks(self, sensor: Frame) -> Tracks:
        """Current tracks in the sensor frame at `sensor`, nearest first.

        After `predict` they are the forecasts for the coming keyframe, after `update` its
        estimates.
        """
        tracks = self._tracks
        local = tracks.moved(
            boxes=sensor.boxes_to_local(tracks.boxes),
            velocities=turned(tracks.velocities, -sensor.yaw),
        )
        # A stable sort: tracks of one distance stay in the order in which they were begun.
        return local.take(np.argsort(local.ranges, kind="stable"))

    def predict(self) -> None:
        """Move every track one keyframe ahead at constant velocity."""
        tracks = self._tracks
        boxes = tracks.boxes.copy()
        boxes[:, :2] += tracks.velocities * self._keyframe_s
        self._tracks = tracks.moved(boxes=boxes, velocities=tracks.velocities)

    def update(self, detections: Detections, sensor: Frame) -> Integers:
        """Assign the detections of this keyframe to the forecasts, start new tracks, drop old ones.

        Returns (n,) the id of the track of every detection.
        """
        # Every detection is of a track, an old one or a new one.
        seen = sensor.boxes_to_world(detections.boxes)
        rows, matched = self._assign(detections.classes, seen)
        new = np.ones(len(detections), bool)
        new[matched] = False
        ids = np.empty(len(detections), np.int64)
        ids[matched] = self._tracks.ids[rows]

        # In this order: rows hold only until old tracks are dropped, and `_correct` counts a miss
        # for every track that it finds.
        self._correct(rows, seen[matched])
        self._drop_lost()
        ids[new] = self._start(detections.classes[new], seen[new])
        return ids

    def velocities(self, ids: Integers, sensor: Frame) -> Floats:
        """(n, 2) over ground, in the axes of `sensor`, of the tracks that `update` has just told; 0
        of a new one.
        """
        # New tracks come last with higher numbers, and dropping keeps the order: ids ascend.
        rows = np.searchsorted(self._tracks.ids, ids)
        return turned(self._tracks.velocities[rows], -sensor.yaw)

    def _assign(self, classes: Integers, seen: Floats) -> tuple[Integers, Integers]:
        """The rows (k,) of the forecasts and of the detections that belong together, pair by pair.

        Detections have `classes` (n,) and stand at `seen` (n, 7) in the world.
        """
        tracks = self._tracks
        offset = tracks.boxes[:, None, :2] - seen[None, :, :2]
        distance = np.hypot(offset[..., 0], offset[..., 1])

        # A track with a velocity is forecast where it should be, and its gate is that of the match.
        # One seen once is forecast where it was, and may have gone any way since.
        elapsed = (tracks.misses + 1) * self._keyframe_s
        slack = np.where(tracks.hits > 1, 0.0, self._rules.first_speed_mps * elapsed)
        gate = self._rules.gate_m + slack
        possible = (distance <= gate[:, None]) & (tracks.classes[:, None] == classes[None, :])

        # Impossible pairs cost more than any sum of possible ones, so the most pairs are matched,
        # and of all such matchings the one with the least sum of distances is taken.
        rows, columns = linear_sum_assignment(np.where(possible, distance, _IMPOSSIBLE_M))
        kept = possible[rows, columns]
        return rows[kept], columns[kept]

    def _correct(self, rows: Integers, seen: Floats) -> None:
        """Age every track by a keyframe; set those at `rows` (n,) to the boxes `seen` (n, 7)."""
        # All tracks miss this keyframe, until those that were detected are set back to 0.
        tracks = self._tracks
        boxes = tracks.boxes.copy()
        velocities = tracks.velocities.copy()
        misses = tracks.misses + 1
        hits = tracks.hits.copy()
        elapsed = (misses[rows] * self._keyframe_s)[:, None]

        # A forecast moved at constant velocity; moved back, it is where the object was last seen.
        # The velocity is the way from there over the time since, however many keyframes that is.
        last_seen = boxes[rows, :2] - velocities[rows] * elapsed
        velocities[rows] = (seen[:, :2] - last_seen) / elapsed
        boxes[rows] = seen
        misses[rows] = 0
        hits[rows] += 1
        self._tracks = Tracks(tracks.ids, tracks.classes, boxes, velocities, misses, hits)

    def _drop_lost(self) -> None:
        """Drop the tracks that have not been detected for too long."""
        alive = self._tracks.misses * self._keyframe_s <= self._rules.coast_s + LAST_BITS_S
        if not alive.all():
            self._tracks = self._tracks.take(alive)

    def _start(self, classes: Integers, boxes: Floats) -> Integers:
        """Begin a track with each of `classes` (n,) and `boxes` (n, 7); their ids (n,)."""
        # Ids count up and are never given again, so each means one object.
        count = len(classes)
        ids = np.arange(self._next_id, self._next_id + count)
        if not count:
            return ids
        self._next_id += count
        old = self._tracks
        self._tracks = Tracks(
            np.concatenate([old.ids, ids]),
            np.concatenate([old.classes, classes]),
            np.concatenate([old.boxes, boxes]),
            np.concatenate([old.velocities, np.zeros((count, 2))]),
            np.concatenate([old.misses, np.zeros(count, np.int64)]),
            np.concatenate([old.hits, np.ones(count, np.int64)]),
        )
        return ids
