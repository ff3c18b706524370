"""False boxes of a measured detector: the candidates that it reports at a keyframe."""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.cells.stack import Grid
from care_sim.core.frames import Frame
from care_sim.core.types import Detections
from care_sim.perception.matching import MATCH_M
from care_sim.perception.measured.candidates import (
    AHEAD,
    COLUMNS,
    KIND,
    LABEL,
    RANK,
    REACH_M,
    RING_M,
    SCORE,
    Place,
    X,
    advance_candidates,
    kinds_of,
)
from care_sim.perception.measured.tables import Measurement
from care_sim.sensors.annotated import Annotations, Cloud

FREE_WIDTH_M, FREE_LENGTH_M = 3.0, 20.0
"""Width and length of the road ahead, where false boxes are rare. None of 1,342 false boxes with a
score of at least 0.3 was there; an even spread would give 8.5.
"""
SHORT_M = 0.5
"""A ray may end this far before the road or the box, as at a kerb."""


class View(NamedTuple):
    """The cells of one LiDAR by ascending azimuth: cells, azimuths, elevations and their cosines.
    Also the ground distances at which their rays meet the road, and the angle between two rows.
    """

    cells: Integers
    azimuths: Floats
    elevations: Floats
    cosines: Floats
    roads: Floats
    row_height: float


class FalseBoxPopulation:
    """The false boxes of one episode with scores of `least_score` or more. The sensor is
    `sensor_height_m` above the road, and keyframes are `keyframe_s` apart.
    """

    def __init__(
        self,
        measured: Measurement,
        least_score: float,
        grid: Grid,
        sensor_height_m: float,
        keyframe_s: float,
        seed: np.random.SeedSequence,
    ):
        self._scores = least_score, measured.most_score
        self._kept_ahead = measured.kept_ahead
        self._height_m = sensor_height_m
        self._kinds = kinds_of(measured, keyframe_s)
        self._grid = grid
        self._seed = seed.generate_state(1, np.uint64)[0]
        self._table = np.empty((0, COLUMNS))
        self._before: Place = math.nan, math.nan

    def draw(self, keyframe: int, sensor: Frame, cloud: Cloud, present: Annotations) -> Detections:
        """Return the false boxes of a keyframe, with scores in the detector's own scale.

        A box is reported only where the scan looks at its place. Within MATCH_M of an object of its
        class a box would be a detection of that object, so no false box is there.
        """
        place = float(sensor.x), float(sensor.y)
        self._table = advance_candidates(
            self._table, self._seed, keyframe, place, self._before, self._kinds
        )
        self._before = place
        # Every least score chooses from the same candidates.
        table = self._table[self._table[:, SCORE] >= self._scores[0]]
        boxes = sensor.boxes_to_local(table[:, X:SCORE])
        boxes[:, 2] = boxes[:, 5] / 2 - self._height_m
        kept = _candidates_now(
            (table, boxes, self._kinds.shares, self._kept_ahead),
            present.classes,
            np.ascontiguousarray(present.boxes, float),
        )
        # Cells are in the current sensor frame: only the last of gathered sweeps counts.
        newest = cloud if cloud.newest is None else cloud.newest
        farthest, in_view = _farthest(newest, self._grid), np.zeros(len(kept), np.bool_)
        for head, view in zip(self._grid.heads, _views(self._grid, self._height_m), strict=True):
            in_view |= _are_in_view(head.boxes(boxes[kept]), farthest, view)
        kept = kept[in_view]
        rows = table[kept]
        none = np.zeros(len(kept), np.int64)
        scores = np.minimum(rows[:, SCORE], self._scores[1])
        return Detections(rows[:, LABEL].astype(np.int64), boxes[kept], none, scores)


@lru_cache(8)
def _views(grid: Grid, sensor_height_m: float) -> tuple[View, ...]:
    views = []
    for head in grid.heads:
        x, y, z = head.grid.directions.T
        azimuths, elevations = np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))
        down = np.tan(np.minimum(elevations, -1e-9))
        roads = np.where(elevations < 0, -(sensor_height_m + head.place[2]) / down, np.inf)
        order = np.argsort(azimuths)
        views.append(
            View(
                head.first + order,
                azimuths[order],
                elevations[order],
                np.cos(elevations)[order],
                roads[order],
                float(head.grid.row_height),
            )
        )
    return tuple(views)


def _farthest(cloud: Cloud, grid: Grid) -> Floats:
    """Return (N,) the farthest range of each cell from its LiDAR, metres, 0 without a return."""
    known = cloud.points if cloud.ranges is None else cloud.ranges
    if len(known) != len(cloud):
        raise InvalidInput(f"a cloud must have a range per return: {len(known)} of {len(cloud)}")
    ranges = grid.ranges_to(cloud.cells, known) if cloud.ranges is None else known
    farthest = np.zeros(grid.size)
    np.maximum.at(farthest, cloud.cells, ranges)
    return farthest


@compiled()
def _candidates_now(
    candidates: tuple[Floats, Floats, Floats, float], classes: Integers, present: Floats
) -> Integers:
    """Return the rows (k,) of the candidates that a free view would show. `candidates` are their
    table (n, 13), boxes (n, 7) in the sensor frame, shares by ring and `kept_ahead`. `present` are
    the boxes (m, 7) of objects of `classes` (m,).
    """
    table, boxes, shares, kept_ahead = candidates
    shown, count = np.empty(len(boxes), np.int64), 0
    for n in range(len(boxes)):
        x, y = boxes[n, 0], boxes[n, 1]
        away = math.hypot(x, y)
        if away >= REACH_M or table[n, RANK] >= shares[int(table[n, KIND]), int(away / RING_M)]:
            continue
        ahead = 0.0 < x < FREE_LENGTH_M and abs(y) < FREE_WIDTH_M / 2
        if ahead and table[n, AHEAD] >= kept_ahead:
            continue
        if not _is_of_another(x, y, table[n, LABEL], classes, present):
            shown[count] = n
            count += 1
    return shown[:count]


@compiled()
def _is_of_another(x: float, y: float, label: float, classes: Integers, boxes: Floats) -> bool:
    """Whether a box at x, y is within MATCH_M of one of `boxes` (n, 7) of its class."""
    for row in range(len(boxes)):
        away = math.hypot(x - boxes[row, 0], y - boxes[row, 1])
        if classes[row] == label and away <= MATCH_M:
            return True
    return False


@compiled()
def _are_in_view(boxes: Floats, farthest: Floats, view: View) -> Mask:
    """Return (n,) which of `boxes` (n, 7) the LiDAR has in view."""
    in_view = np.empty(len(boxes), np.bool_)
    for n in range(len(boxes)):
        in_view[n] = _is_in_view(boxes[n], farthest, view)
    return in_view


@compiled()
def _is_in_view(box: Floats, farthest: Floats, view: View) -> bool:
    """Return True if a ray ends at a `box` (7,) or beyond; `farthest` (N,) are the ranges of all
    cells, 0 without a return. A ray of the row below may also end on the road before the box. A ray
    at the height of the box that ends too early rules this out, since a wall may stand between.
    """
    away = math.hypot(box[0], box[1])
    near = away - max(box[3], box[4]) / 2
    wide = math.atan2(max(box[3], box[4]) / 2, away)
    azimuth = math.atan2(box[1], box[0])
    foot = math.atan2(box[2] - box[5] / 2, away)
    # If rows are farther apart than the box is high, the height of the box still has a row.
    top = max(math.atan2(box[2] + box[5] / 2, away), foot + view.row_height)
    is_road_seen = is_hidden = False
    for turn in (-2 * math.pi, 0.0, 2 * math.pi):
        first = np.searchsorted(view.azimuths, azimuth + turn - wide)
        for place in range(first, len(view.azimuths)):
            if view.azimuths[place] > azimuth + turn + wide:
                break
            elevation = view.elevations[place]
            ends = farthest[view.cells[place]] * view.cosines[place]
            if ends <= 0.0 or not foot - view.row_height <= elevation <= top:
                continue
            is_far = ends >= min(view.roads[place], near) - SHORT_M
            if elevation >= foot and is_far:
                return True
            is_road_seen = is_road_seen or is_far
            is_hidden = is_hidden or elevation >= foot
    return is_road_seen and not is_hidden
