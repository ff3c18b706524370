"""False boxes of a measured detector: those of the candidates that it reports at a keyframe."""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers
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
"""The road ahead on which false boxes are rare, wide and long. Of 1,342 from a score of 0.3 on, 0
were there, where 8.5 would have been if false boxes were evenly spread over all directions."""
SHORT_M = 0.5
"""A ray may end so far before the road or the box that it looks at, as at a kerb."""


class View(NamedTuple):
    """All cells of a grid by ascending azimuth: cells, azimuths, elevations and their cosines, and
    the distances on the ground at which their rays meet the road; the angle between two rows.
    """

    cells: Integers
    azimuths: Floats
    elevations: Floats
    cosines: Floats
    roads: Floats
    row_height: float


class FalseBoxPopulation:
    """The false boxes of one episode with scores of `least_score` or more, a sensor that stands
    `sensor_height_m` above the road, and keyframes `keyframe_s` apart.
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
        self._most_score = measured.most_score
        self._kept_ahead = measured.kept_ahead
        self._height_m = sensor_height_m
        self._kinds = kinds_of(measured, least_score, keyframe_s)
        self._grid = grid
        self._seed = seed.generate_state(1, np.uint64)[0]
        self._table = np.empty((0, COLUMNS))
        self._before: Place = math.nan, math.nan

    def draw(self, keyframe: int, sensor: Frame, cloud: Cloud, present: Annotations) -> Detections:
        """The false boxes of a keyframe, with scores in the detector's own scale.

        Nothing comes from nothing: a box is reported where the scan looks at it. Within MATCH_M of
        an object of its class a box is a detection of that object, and none is false.
        """
        place = float(sensor.x), float(sensor.y)
        self._table = advance_candidates(
            self._table, self._seed, keyframe, place, self._before, self._kinds
        )
        self._before = place
        boxes = sensor.boxes_to_local(self._table[:, X:SCORE])
        boxes[:, 2] = boxes[:, 5] / 2 - self._height_m
        kept = _shown(
            (self._table, boxes, self._kinds.shares, self._kept_ahead),
            (present.classes, np.ascontiguousarray(present.boxes, float)),
            (cloud.cells, _ranges(cloud)),
            _view(self._grid, self._height_m),
        )
        rows = self._table[kept]
        none = np.zeros(len(kept), np.int64)
        scores = np.minimum(rows[:, SCORE], self._most_score)
        return Detections(rows[:, LABEL].astype(np.int64), boxes[kept], none, scores)


@lru_cache(8)
def _view(grid: Grid, sensor_height_m: float) -> View:
    x, y, z = grid.directions.T
    azimuths, elevations = np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))
    heights = np.empty(len(z))
    for head in grid.heads:
        heights[head.cells] = sensor_height_m + head.place[2]
    down = np.tan(np.minimum(elevations, -1e-9))
    roads = np.where(elevations < 0, -heights / down, np.inf)
    order = np.argsort(azimuths)
    cosines = np.cos(elevations)
    return View(
        order,
        azimuths[order],
        elevations[order],
        cosines[order],
        roads[order],
        float(grid.row_height),
    )


def _ranges(cloud: Cloud) -> Floats:
    """(P,) the ranges of the returns, metres."""
    if cloud.ranges is not None:
        return cloud.ranges
    return np.asarray(np.sqrt((cloud.points**2).sum(axis=1)))


@compiled()
def _shown(
    candidates: tuple[Floats, Floats, Floats, float],
    present: tuple[Integers, Floats],
    returned: tuple[Integers, Floats],
    view: View,
) -> Integers:
    """The rows (k,) of the candidates that are reported. The `candidates` are their table (n, 13),
    boxes (n, 7) in the sensor frame, shares by ring and `kept_ahead`; `present` are classes and
    boxes of objects, `returned` the cells (P,) and ranges (P,) of all returns.
    """
    table, boxes, shares, kept_ahead = candidates
    farthest = np.zeros(len(view.cells))
    cells, ranges = returned
    for row in range(len(cells)):
        farthest[cells[row]] = max(farthest[cells[row]], ranges[row])
    shown, count = np.empty(len(boxes), np.int64), 0
    for n in range(len(boxes)):
        x, y = boxes[n, 0], boxes[n, 1]
        away = math.hypot(x, y)
        if away >= REACH_M or table[n, RANK] >= shares[int(table[n, KIND]), int(away / RING_M)]:
            continue
        ahead = 0.0 < x < FREE_LENGTH_M and abs(y) < FREE_WIDTH_M / 2
        if ahead and table[n, AHEAD] >= kept_ahead:
            continue
        if _is_of_another(x, y, table[n, LABEL], present[0], present[1]):
            continue
        if _is_looked_at(boxes[n], farthest, view):
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
def _is_looked_at(box: Floats, farthest: Floats, view: View) -> bool:
    """Whether a ray looks at a `box` (7,) or at the road just before it, and ends there or beyond;
    `farthest` (N,) are the ranges of all cells, 0 without a return.
    """
    away = math.hypot(box[0], box[1])
    near = away - max(box[3], box[4]) / 2
    wide = math.atan2(max(box[3], box[4]) / 2, away)
    azimuth = math.atan2(box[1], box[0])
    lowest = math.atan2(box[2] - box[5] / 2, away) - view.row_height
    highest = math.atan2(box[2] + box[5] / 2, away)
    for turn in (-2 * math.pi, 0.0, 2 * math.pi):
        first = np.searchsorted(view.azimuths, azimuth + turn - wide)
        for place in range(first, len(view.azimuths)):
            if view.azimuths[place] > azimuth + turn + wide:
                break
            if not lowest <= view.elevations[place] <= highest:
                continue
            ends = farthest[view.cells[place]] * view.cosines[place]
            if ends > 0.0 and ends >= min(view.roads[place], near) - SHORT_M:
                return True
    return False
