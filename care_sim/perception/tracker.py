"""Track memory: assignment by position, velocity from the last keyframes, coasting, forecasts.

Tracks are a table (m, 13) in the order of `Tracks.COLUMNS`, by ascending id, in the world frame.
Detections are their `classes` (n,) and their boxes `seen` (n, 7), in the world frame, too.

A track is the least-squares line through its detections, in recursive form: the expanding-memory
polynomial filter of degree 1. Sources: Morrison 1969, "Introduction to Sequential Smoothing and
Prediction"; Brookner 1998, "Tracking and Kalman Filtering Made Easy". A line through two detections
meets both: then place and velocity are as detected.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.base.times import LAST_BITS_S
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.frames import Frame, turned
from care_sim.core.rows import copy_row
from care_sim.core.types import Detections, Tracks

# Compiled code can only read module-level constants.
_ID, _CLASS, _X, _Y = Tracks.ID, Tracks.CLASS, Tracks.CENTRE.start, Tracks.CENTRE.start + 1
_VX, _VY = Tracks.VELOCITY.start, Tracks.VELOCITY.start + 1
_BOX, _BOX_WIDTH = Tracks.BOX.start, Tracks.BOX.stop - Tracks.BOX.start
_MISSES, _HITS = Tracks.MISSES, Tracks.HITS


Rules = tuple[float, float, float, float, float]
"""The fields of `Life`."""
Pairs = tuple[Integers, Integers]
"""The rows (k,) of tracks, and of the detections that belong to them."""


class Life(NamedTuple):
    """Rules of association and life of a track (`care_sim.perception.tracker.MemoryRules`)."""

    keyframe_s: float
    gate_m: float
    first_speed_mps: float
    coast_s: float
    velocity_keyframes: float


@compiled()
def forecast(tracks: Floats, seconds: float) -> Floats:
    """Return the tracks `seconds` later, at constant velocity."""
    moved = tracks.copy()
    forecast_in_place(moved, seconds)
    return moved


@compiled()
def forecast_in_place(tracks: Floats, seconds: float) -> None:
    """Move the tracks as `forecast` does, in place."""
    for m in range(len(tracks)):
        tracks[m, _X] += tracks[m, _VX] * seconds
        tracks[m, _Y] += tracks[m, _VY] * seconds


@compiled()
def sort_by_distance(tracks: Floats, boxes: Floats, turn: tuple[float, float]) -> Floats:
    """Return the tracks with `boxes` (m, 7) of a sensor's frame, the nearest first. `turn` is the
    cosine and sine of the angle that turns velocities into its axes.
    """
    cos, sin = turn
    ranges = np.empty(len(tracks))
    seen = np.empty(tracks.shape)
    for m in range(len(tracks)):
        # Each goes behind all that are not farther: equally far tracks stay in the order of their
        # beginning.
        away = math.hypot(boxes[m, 0], boxes[m, 1])
        place = m
        while place > 0 and ranges[place - 1] > away:
            ranges[place] = ranges[place - 1]
            copy_row(seen[place - 1], seen[place])
            place -= 1
        ranges[place] = away
        copy_row(tracks[m], seen[place])
        _put_box(seen[place], boxes[m])
        seen[place, _VX] = cos * tracks[m, _VX] - sin * tracks[m, _VY]
        seen[place, _VY] = sin * tracks[m, _VX] + cos * tracks[m, _VY]
    return seen


@compiled()
def possible_pairs(
    tracks: Floats, classes: Integers, seen: Floats, rules: Rules
) -> tuple[Floats, Mask, Pairs, bool]:
    """Return (m, n) metres between forecasts and detections, and (m, n) which pairs can be one
    object. Also returns the rows of both in these pairs, and whether no row is in two pairs.
    """
    life = Life(*rules)
    distances = np.empty((len(tracks), len(seen)))
    possible = np.zeros(distances.shape, np.bool_)
    rows = np.empty(len(seen), np.int64)
    columns = np.empty(len(seen), np.int64)
    is_taken = np.zeros(len(seen), np.bool_)
    count = 0
    alone = True
    for m in range(len(tracks)):
        # A track with a velocity is forecast where it should be, and its gate is that of the match.
        # One seen once is forecast where it was, and may have gone any way since.
        gate = life.gate_m
        if tracks[m, _HITS] <= 1:
            gate += life.first_speed_mps * ((tracks[m, _MISSES] + 1) * life.keyframe_s)
        before = count
        for n in range(len(seen)):
            distances[m, n] = math.hypot(tracks[m, _X] - seen[n, 0], tracks[m, _Y] - seen[n, 1])
            if distances[m, n] <= gate and tracks[m, _CLASS] == classes[n]:
                possible[m, n] = True
                alone = alone and count == before and not is_taken[n]
                if alone:
                    is_taken[n] = True
                    rows[count], columns[count] = m, n
                    count += 1
    return distances, possible, (rows[:count], columns[:count]), alone


@compiled()
def advance_tracks(
    tracks: Floats, classes: Integers, seen: Floats, pairs: Pairs, rules: Rules, next_id: int
) -> tuple[Floats, Integers]:
    """Return the tracks a keyframe later, and (n,) the id of each detection's track.

    `pairs` belong together. A detection without a track begins one, from `next_id` on.
    """
    life = Life(*rules)
    rows, columns = pairs
    detected = np.full(len(tracks), -1)
    for k in range(len(rows)):
        detected[rows[k]] = columns[k]

    # Tracks without a detection for too long are dropped; new ones come last. Ids count up and are
    # never reused, so each means one object.
    result = np.empty((len(tracks) + len(seen), tracks.shape[1]))
    ids = np.full(len(seen), -1)
    count = 0
    for m in range(len(tracks)):
        n = detected[m]
        elapsed = (tracks[m, _MISSES] + 1) * life.keyframe_s
        if n < 0 and elapsed > life.coast_s + LAST_BITS_S:
            continue
        copy_row(tracks[m], result[count])
        result[count, _MISSES] += 1
        if n >= 0:
            _follow(result[count], seen[n], elapsed, life)
            ids[n] = int(tracks[m, _ID])
        count += 1
    for n in range(len(seen)):
        if ids[n] < 0:
            ids[n] = next_id
            _begin(result[count], next_id, classes[n], seen[n])
            next_id += 1
            count += 1
    return result[:count], ids


@compiled()
def _follow(track: Floats, box: Floats, elapsed: float, life: Life) -> None:
    """Update a track with its detected `box` (7,), `elapsed` seconds after the last one. Size,
    height and yaw are the box's.
    """
    before = min(track[_HITS], life.velocity_keyframes - 1)
    if before < 2:
        # A forecast moved at constant velocity; moved back, it is where the object was last seen.
        # The velocity is the way from there over the time since, however many keyframes that is.
        track[_VX] = (box[0] - (track[_X] - track[_VX] * elapsed)) / elapsed
        track[_VY] = (box[1] - (track[_Y] - track[_VY] * elapsed)) / elapsed
        _put_box(track, box)
    else:
        place, velocity = _gains(before, elapsed / life.keyframe_s)
        x, y = track[_X], track[_Y]
        off_x, off_y = box[0] - x, box[1] - y
        track[_VX] += velocity * off_x / life.keyframe_s
        track[_VY] += velocity * off_y / life.keyframe_s
        _put_box(track, box)
        track[_X], track[_Y] = x + place * off_x, y + place * off_y
    track[_MISSES] = 0.0
    track[_HITS] += 1


@compiled()
def _gains(before: float, steps: float) -> tuple[float, float]:
    """Return the gains: the share of the way from a forecast to its detection that is added to the
    place, and, per keyframe, to the velocity.

    The forecast is `steps` keyframes ahead of a line through `before` detections, one a keyframe
    and all with errors of variance 1. With 1 step and n = before + 1 they are the usual alpha =
    2 (2n - 1) / (n (n + 1)) and beta = 6 / (n (n + 1)).
    """
    # Variance of the place at the end of such a line, of its velocity, and of both together.
    ends = 2 * (2 * before - 1) / (before * (before + 1))
    both = 6 / (before * (before + 1))
    slope = 12 / (before * (before * before - 1))
    spread = ends + 2 * steps * both + steps * steps * slope
    return spread / (spread + 1), (both + steps * slope) / (spread + 1)


@compiled()
def _begin(track: Floats, number: int, label: int, box: Floats) -> None:
    """Make a row the track of a new detection."""
    for k in range(len(track)):
        track[k] = 0.0
    track[_ID], track[_CLASS], track[_HITS] = number, label, 1.0
    _put_box(track, box)


@compiled()
def _put_box(track: Floats, box: Floats) -> None:
    for k in range(_BOX_WIDTH):
        track[_BOX + k] = box[k]


_IMPOSSIBLE_M = 1e6
"""The cost of a pair that cannot be one object, in metres of distance: more than all others."""


@dataclass(frozen=True)
class MemoryRules:
    """Association and life of a track."""

    gate_m: float = 2.0
    """A detection farther from a forecast is another object (the paper's match distance)."""
    first_speed_mps: float = 15.0
    """A track seen once has no velocity: its gate grows by this much per second (54 km/h)."""
    coast_s: float = 1.5
    """An undetected track is forecast this long, then dropped: 15 keyframes of the closed loop, 3
    of the open one (CenterPoint's tracker: 3 frames at 2 Hz).
    """
    velocity_keyframes: int = 2
    """Place and velocity are a line through this many detections. Then the gains stay constant: the
    filter slowly forgets older detections.
    """

    def life(self, keyframe_s: float) -> Rules:
        """Return these rules for keyframes `keyframe_s` seconds apart, for compiled code."""
        # Plain numbers, which compiled code takes at once.
        return (
            float(keyframe_s),
            float(self.gate_m),
            float(self.first_speed_mps),
            float(self.coast_s),
            float(self.velocity_keyframes),
        )


class TrackMemory:
    """The tracks of an episode.

    Tracks are stored in the world frame, which compensates the ego's motion. Methods take and
    return them in the sensor frame.
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
        return Tracks.from_checked_rows(sort_by_distance(self._table, boxes, sensor.turn_back))

    def predict(self) -> None:
        """Move every track one keyframe ahead at constant velocity."""
        self._table = forecast(self._table, self._keyframe_s)

    def update(self, detections: Detections, sensor: Frame) -> Integers:
        """Assign the detections of this keyframe to the forecasts, start new tracks, drop old ones.

        Returns (n,) the id of the track of every detection.
        """
        classes = np.ascontiguousarray(detections.classes, np.int64)
        seen = sensor.boxes_to_world(detections.boxes)
        pairs = assign_pairs(self._table, classes, seen, self._life)
        self._table, ids = advance_tracks(
            self._table, classes, seen, pairs, self._life, self._next_id
        )
        self._next_id = max(self._next_id, ids.max(initial=-1) + 1)
        return ids

    def velocities(self, ids: Integers, sensor: Frame) -> Floats:
        """Return (n, 2) velocities over ground, in the axes of `sensor`, of the tracks that
        `update` just returned; 0 for a new one.
        """
        # New tracks come last with higher numbers, and dropping keeps the order: ids ascend.
        rows = np.searchsorted(self._table[:, Tracks.ID], ids)
        return turned(self._table[rows, Tracks.VELOCITY], -sensor.yaw)


def assign_pairs(tracks: Floats, classes: Integers, seen: Floats, life: Rules) -> Pairs:
    """Return the rows (k,) of matching forecasts and detections, pair by pair."""
    from scipy.optimize import linear_sum_assignment

    distances, possible, pairs, alone = possible_pairs(tracks, classes, seen, life)
    # Nearly always no row is in two pairs, and all pairs match.
    if alone:
        return pairs

    # Impossible pairs cost more than any sum of possible ones, so the most pairs are matched, and
    # of all such matchings the one with the least sum of distances is taken.
    rows, columns = linear_sum_assignment(np.where(possible, distances, _IMPOSSIBLE_M))
    kept = possible[rows, columns]
    return rows[kept], columns[kept]
