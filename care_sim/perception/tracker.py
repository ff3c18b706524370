"""Track memory: assignment by position, velocity from two keyframes, coasting, forecasts."""

from dataclasses import dataclass

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.frames import Frame, turned
from care_sim.core.types import Detections, Tracks
from care_sim.perception import track_kernels as kernels

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

    def life(self, keyframe_s: float) -> kernels.Rules:
        """These rules where keyframes are `keyframe_s` seconds apart, as compiled code takes
        them.
        """
        # Plain numbers, which compiled code takes at once.
        return (
            float(keyframe_s),
            float(self.gate_m),
            float(self.first_speed_mps),
            float(self.coast_s),
        )


class TrackMemory:
    """The tracks of an episode.

    They are kept in the world frame, so that the ego's motion is compensated, and are given and
    taken in the sensor frame.
    """

    def __init__(self, keyframe_s: float, rules: MemoryRules = MemoryRules()):
        self._keyframe_s = float(keyframe_s)
        self._life = rules.life(keyframe_s)
        self._table = np.empty((0, len(Tracks.COLUMNS)))
        self._next_id = 0

    def tracks(self, sensor: Frame) -> Tracks:
        """Current tracks in the sensor frame at `sensor`, nearest first.

        After `predict` they are the forecasts for the coming keyframe, after `update` its
        estimates.
        """
        boxes = sensor.boxes_to_local(self._table[:, Tracks.BOX])
        return Tracks.from_checked_rows(
            kernels.seen_nearest_first(self._table, boxes, sensor.turn_back)
        )

    def predict(self) -> None:
        """Move every track one keyframe ahead at constant velocity."""
        self._table = kernels.forecast(self._table, self._keyframe_s)

    def update(self, detections: Detections, sensor: Frame) -> Integers:
        """Assign the detections of this keyframe to the forecasts, start new tracks, drop old ones.

        Returns (n,) the id of the track of every detection.
        """
        classes = np.ascontiguousarray(detections.classes, np.int64)
        seen = sensor.boxes_to_world(detections.boxes)
        pairs = assigned(self._table, classes, seen, self._life)
        self._table, ids = kernels.lived_on(
            self._table, classes, seen, pairs, self._life, self._next_id
        )
        self._next_id = max(self._next_id, ids.max(initial=-1) + 1)
        return ids

    def velocities(self, ids: Integers, sensor: Frame) -> Floats:
        """(n, 2) over ground, in the axes of `sensor`, of the tracks that `update` has just told; 0
        of a new one.
        """
        # New tracks come last with higher numbers, and dropping keeps the order: ids ascend.
        rows = np.searchsorted(self._table[:, Tracks.ID], ids)
        return turned(self._table[rows, Tracks.VELOCITY], -sensor.yaw)


def assigned(tracks: Floats, classes: Integers, seen: Floats, life: kernels.Rules) -> kernels.Pairs:
    """The rows (k,) of forecasts and of detections that belong together, pair by pair.

    The forecasts are a table of `care_sim.perception.track_kernels`. Detections have `classes` (n,)
    and stand at `seen` (n, 7) in the world.
    """
    from scipy.optimize import linear_sum_assignment

    distances, possible, pairs, alone = kernels.possible_pairs(tracks, classes, seen, life)
    # Nearly always each can be one alone, and all pairs belong together.
    if alone:
        return pairs

    # Impossible pairs cost more than any sum of possible ones, so the most pairs are matched, and
    # of all such matchings the one with the least sum of distances is taken.
    rows, columns = linear_sum_assignment(np.where(possible, distances, _IMPOSSIBLE_M))
    kept = possible[rows, columns]
    return rows[kept], columns[kept]
