"""False boxes of a measured detector: the candidates that it reports at a keyframe."""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers
from care_sim.core.cells.stack import Grid
from care_sim.core.rows import copy_row
from care_sim.perception.found import Found
from care_sim.perception.matching import MATCH_M
from care_sim.perception.measured.candidates import (
    AHEAD,
    KIND,
    LABEL,
    RANK,
    REACH_M,
    RING_M,
    SCORE,
    SEEN,
    Candidates,
)
from care_sim.perception.measured.reporting import Rules
from care_sim.sensors.annotated import NO_OBJECT

FREE_WIDTH_M, FREE_LENGTH_M = 3.0, 20.0
"""Width and length of the road ahead, where false boxes are rare. None of 1,342 false boxes with a
score of at least 0.3 was there; an even spread would give 8.5.
"""
SHORT_M = 0.5
"""A ray may end this far before the road or the box, as at a kerb."""


class View(NamedTuple):
    """The cells of every LiDAR by ascending azimuth, those of the first LiDAR first: cells,
    azimuths, elevations and their cosines. Also the ground distances at which their rays meet the
    road.
    """

    cells: Integers
    azimuths: Floats
    elevations: Floats
    cosines: Floats
    roads: Floats
    firsts: Integers
    """(h + 1,) where the cells of each LiDAR begin and end."""
    places: Floats
    """(h, 3) where the LiDARs are in the sensor frame."""
    row_heights: Floats
    """(h,) the angles between two rows."""


@lru_cache(8)
def view_of(grid: Grid, sensor_height_m: float) -> View:
    """Return the view of a sensor `sensor_height_m` above the road."""
    columns = []
    for head in grid.heads:
        x, y, z = head.grid.directions.T
        azimuths, elevations = np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))
        down = np.tan(np.minimum(elevations, -1e-9))
        roads = np.where(elevations < 0, -(sensor_height_m + head.place[2]) / down, np.inf)
        order = np.argsort(azimuths)
        own = azimuths, elevations, np.cos(elevations), roads
        columns.append([head.first + order, *(column[order] for column in own)])
    cells, azimuths, elevations, cosines, roads = map(np.concatenate, zip(*columns, strict=True))
    return View(
        cells,
        azimuths,
        elevations,
        cosines,
        roads,
        np.array([*(head.first for head in grid.heads), grid.size]),
        np.array([head.place for head in grid.heads], float),
        np.array([head.grid.row_height for head in grid.heads], float),
    )


@compiled()
def report_false_boxes(
    w: int,
    candidates: Candidates,
    present: tuple[Integers, Floats],
    farthest: Floats,
    view: View,
    rules: Rules,
    found: Found,
) -> None:
    """Add the false boxes of a world `w` to those `found`. `farthest` (N,) are the ranges of all
    cells, 0 without a return. `present` are the classes (n,) and boxes (n, 7) of its objects.
    """
    for row in candidates.rows[w, : candidates.counts[w]]:
        box = row[SEEN:]
        box[2] = box[5] / 2 - rules.sensor_height_m
        if _is_free(row, present, rules) and _is_in_view(box, farthest, view):
            at = found.counts[w]
            found.classes[w, at], found.objects[w, at] = int(row[LABEL]), NO_OBJECT
            found.scores[w, at], found.returns[w, at] = min(row[SCORE], rules.most), 0
            copy_row(box, found.boxes[w, at])
            found.counts[w] += 1


@compiled()
def _is_free(row: Floats, present: tuple[Integers, Floats], rules: Rules) -> bool:
    """Whether a free view would show a candidate (20,). Within MATCH_M of an object of its class a
    box would be a detection of that object, so no false box is there.
    """
    x, y = row[SEEN], row[SEEN + 1]
    away = math.hypot(x, y)
    shares = rules.kinds.shares[int(row[KIND])]
    if away >= REACH_M or row[RANK] >= shares[int(away / RING_M)]:
        return False
    if 0.0 < x < FREE_LENGTH_M and abs(y) < FREE_WIDTH_M / 2 and row[AHEAD] >= rules.kept_ahead:
        return False
    classes, boxes = present
    for n in range(len(boxes)):
        if classes[n] == row[LABEL] and math.hypot(x - boxes[n, 0], y - boxes[n, 1]) <= MATCH_M:
            return False
    return True


@compiled()
def _is_in_view(box: Floats, farthest: Floats, view: View) -> bool:
    """Whether a LiDAR has a `box` (7,) in view; see `report_false_boxes`."""
    seen = False
    for head in range(len(view.places)):
        seen = seen or _is_in_view_of(head, box, farthest, view)
    return seen


@compiled()
def _is_in_view_of(head: int, box: Floats, farthest: Floats, view: View) -> bool:
    """Return True if a ray of one LiDAR ends at a `box` (7,) or beyond. A ray of the row below may
    also end on the road before the box. A ray at the height of the box that ends too early rules
    this out, since a wall may stand between.
    """
    x, y = box[0] - view.places[head, 0], box[1] - view.places[head, 1]
    z, row_height = box[2] - view.places[head, 2], view.row_heights[head]
    begin, end = view.firsts[head], view.firsts[head + 1]
    away = math.hypot(x, y)
    near = away - max(box[3], box[4]) / 2
    wide = math.atan2(max(box[3], box[4]) / 2, away)
    azimuth = math.atan2(y, x)
    foot = math.atan2(z - box[5] / 2, away)
    # If rows are farther apart than the box is high, the height of the box still has a row.
    top = max(math.atan2(z + box[5] / 2, away), foot + row_height)
    is_road_seen = is_hidden = False
    for turn in (-2 * math.pi, 0.0, 2 * math.pi):
        first = np.searchsorted(view.azimuths[begin:end], azimuth + turn - wide)
        for place in range(begin + first, end):
            if view.azimuths[place] > azimuth + turn + wide:
                break
            elevation = view.elevations[place]
            ends = farthest[view.cells[place]] * view.cosines[place]
            if ends <= 0.0 or not foot - row_height <= elevation <= top:
                continue
            is_far = ends >= min(view.roads[place], near) - SHORT_M
            if elevation >= foot and is_far:
                return True
            is_road_seen = is_road_seen or is_far
            is_hidden = is_hidden or elevation >= foot
    return is_road_seen and not is_hidden
