"""A keyframe as a set of items: every camera box, every track, and strips of cells for everything
else.
"""

from typing import NamedTuple

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.belief import Belief
from care_sim.core.cells.sets import CellSets
from care_sim.core.residual import explaining_tracks, wedge_rays, wedges
from care_sim.core.rig import Rig
from care_sim.core.types import CLASSES
from care_sim.policies.learned.cell_inputs import RIG_INPUTS, CellInputs
from care_sim.policies.learned.set_kernels import (
    Numbers,
    covered_shares,
    look_at_strips,
    look_back,
)
from care_sim.policies.own.care import CORE_FIRST
from care_sim.policies.paper.tracks import GROUND_CLEARANCE_M

LOOKED_AT = 24
"""Number of an item's cells whose last returns are its inputs."""
STRIP_COLUMNS = 8
STRIP_ROWS_DEG = (-14.0, 3.0)
"""Strips lie between these elevations: 14 degrees down the road is 7 m away."""
_OF_KIND = ("is a camera box", *(f"is a {name}" for name in CLASSES))
_OF_PLACE = ("sin azimuth", "cos azimuth", "elevation", "log size", "width", "height", "range")
_OF_BOX = ("confidence", "age", "explained")
_OF_TRACK = ("shown", "hits", "unseen", "velocity ahead", "velocity to the left")
_OF_SCAN = ("covered", "fired", "returned", "nearness of returns", "standing")
_OF_CAR = ("speed of the car", "yaw rate", "keyframe", "boxes", "tracks")
ITEM_INPUTS = (*_OF_KIND, *_OF_PLACE, *_OF_BOX, *_OF_TRACK, *_OF_SCAN, *_OF_CAR)
"""Inputs of a box or a track, all of the order of 1; inputs of the other kind are 0."""
MIRRORED = np.isin(ITEM_INPUTS, ("sin azimuth", "velocity to the left", "yaw rate"))
"""(inputs,) marks inputs that change their sign when left and right are exchanged."""
STRIP_INPUTS = (
    "in hulls", "in boxes", *_OF_SCAN[1:],
    "cos azimuth", "height of a ray", "in a picture",
    "speed of the car", "keyframe", "boxes", "tracks",
)  # fmt: skip
"""Inputs of a strip, besides its place."""

_PLACE = len(_OF_KIND)
_LOG_SIZE = ITEM_INPUTS.index("log size")
_BOX = _PLACE + len(_OF_PLACE)
_TRACK = _BOX + len(_OF_BOX)
_SCAN = _TRACK + len(_OF_TRACK)
_CAR = _SCAN + len(_OF_SCAN)
"""Columns of `ITEM_INPUTS` at which each part begins."""
_HEIGHTS_M = np.array([1.5, 3.0, 3.0, 1.7, 1.7])
"""Approximate height of each class, which turns a box into a range."""
_LONGEST_S = 2.0
"""Longer times are clipped to this."""


class Items(NamedTuple):
    """The items of a keyframe: `boxes` camera boxes, then all tracks, the nearest first. Their
    cells are `sets`, the core first. `inputs` are (n, `ITEM_INPUTS`), `strips` (S, `STRIP_INPUTS`).
    """

    sets: CellSets
    boxes: int
    inputs: Numbers
    strips: Numbers


class ItemReader:
    """Makes items from beliefs of a `rig` with one level LiDAR of a full turn. Each item lists at
    most its first `most` cells.

    `strips` (S, `STRIP_COLUMNS`) are the cells of the strips, row by row from the top. `places`
    (S,) number the strips; mirrored strips share a place.
    """

    def __init__(self, rig: Rig, most: int):
        self.rig = rig
        self._most = most
        grid = rig.grid.heads[0].grid
        low, high = np.deg2rad(STRIP_ROWS_DEG)
        rows = np.flatnonzero((grid.elevations > low) & (grid.elevations < high))
        across = grid.columns // STRIP_COLUMNS
        columns = np.arange(across * STRIP_COLUMNS).reshape(across, STRIP_COLUMNS)
        self.strips = (rows[:, None, None] * grid.columns + columns).reshape(-1, STRIP_COLUMNS)
        # The first column begins straight behind, where the last one ends.
        folded = np.minimum(np.arange(across), np.arange(across)[::-1])
        self.places = (np.arange(len(rows))[:, None] * (-(-across // 2)) + folded).ravel()
        x, _, z = grid.directions[self.strips].mean(axis=1).T
        covered = CellInputs(rig).rig_inputs[self.strips, RIG_INPUTS.index("in a picture")]
        self._of_places = np.stack([x / np.sqrt(1 - z**2), z / 0.25, covered.mean(axis=1)], 1)
        # A nearer return is above a level road.
        falls = -grid.directions[:, 2]
        clear_m = max(rig.sensor_height_m - GROUND_CLEARANCE_M, 0.0)
        self._road = np.where(falls > 0, clear_m / np.maximum(falls, 1e-9), np.inf)

    def of(self, belief: Belief) -> Items:
        """Return the items of a keyframe."""
        rig = self.rig
        detections, tracks = belief.detections, belief.tracks
        seen, hulls = wedges(detections, rig), rig.hulls(tracks.boxes)
        marks = np.zeros(rig.grid.size, np.uint8)
        covered = covered_shares(hulls.cells, hulls.sizes, seen.cells, seen.sizes, marks)
        every = CellSets.joined([seen, hulls])
        sets = rig.listed(every, CORE_FIRST, self._most)
        ranges = np.ascontiguousarray(belief.ranges).ravel()
        reach = float(np.float32(rig.grid.range_m))
        looked = look_back(sets.cells, sets.sizes, ranges, self._road, reach, LOOKED_AT)

        inputs = np.zeros((len(sets), len(ITEM_INPUTS)), np.float32)
        explaining = explaining_tracks(detections, tracks, rig)
        self._tell_boxes(inputs[: len(detections)], belief, explaining)
        self._tell_tracks(inputs[len(detections) :], belief, explaining)
        inputs[:, _LOG_SIZE] = np.log2(1 + every.sizes) / 10
        inputs[:, _SCAN] = covered
        inputs[:, _SCAN + 1 : _CAR] = looked
        speed, boxes = belief.ego.speed / 15, np.log2(1 + len(detections)) / 6
        known = np.log2(1 + len(tracks)) / 6
        inputs[:, _CAR:] = speed, belief.ego.yaw_rate, rig.keyframe_s, boxes, known

        strips = np.empty((len(self.strips), len(STRIP_INPUTS)), np.float32)
        look_at_strips(self.strips, ranges, self._road, reach, marks, strips)
        strips[:, 6:9] = self._of_places
        strips[:, 9:] = speed, rig.keyframe_s, boxes, known
        return Items(sets, len(detections), inputs, strips)

    def _tell_boxes(self, rows: Numbers, belief: Belief, explaining: Integers) -> None:
        """Fill the rows of boxes (n, `ITEM_INPUTS`); the rest of them is 0."""
        detections = belief.detections
        if not len(detections):
            return
        x, y, z = np.moveaxis(wedge_rays(detections, self.rig), -1, 0)
        azimuths, elevations = np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))
        # Relative to the middle, so that the seam behind the car is no gap.
        off = (azimuths - azimuths[:, :1] + np.pi) % (2 * np.pi) - np.pi
        width = off.max(axis=1) - off.min(axis=1)
        height = elevations.max(axis=1) - elevations.min(axis=1)
        range_m = _HEIGHTS_M[detections.classes] / np.maximum(height, 1e-3)
        rows[:, 0] = 1
        _tell_places(rows, detections.classes, azimuths[:, 0], elevations[:, 0])
        _tell_sizes(rows, width, height, range_m)
        rows[:, _BOX] = detections.confidences
        rows[:, _BOX + 1] = np.minimum(detections.ages, _LONGEST_S)
        rows[:, _BOX + 2] = explaining >= 0

    def _tell_tracks(self, rows: Numbers, belief: Belief, explaining: Integers) -> None:
        """Fill the rows of tracks (n, `ITEM_INPUTS`); the rest of them is 0."""
        tracks = belief.tracks
        x, y, z, length, width, height, _ = tracks.boxes.T
        range_m = np.maximum(np.hypot(x, y), 1.0)
        _tell_places(rows, tracks.classes, np.arctan2(y, x), np.arctan2(z, range_m))
        _tell_sizes(rows, np.hypot(length, width) / range_m, height / range_m, range_m)
        rows[explaining[explaining >= 0], _TRACK] = 1
        rows[:, _TRACK + 1] = np.minimum(np.log2(1 + tracks.hits), 5) / 5
        unseen_s = (tracks.misses + 1) * self.rig.keyframe_s
        rows[:, _TRACK + 2] = np.minimum(unseen_s, _LONGEST_S)
        rows[:, _TRACK + 3 : _SCAN] = tracks.velocities / 15


def _tell_places(rows: Numbers, classes: Integers, azimuths: Floats, elevations: Floats) -> None:
    rows[np.arange(len(rows)), 1 + classes] = 1
    rows[:, _PLACE] = np.sin(azimuths)
    rows[:, _PLACE + 1] = np.cos(azimuths)
    rows[:, _PLACE + 2] = elevations / 0.25


def _tell_sizes(rows: Numbers, widths: Floats, heights: Floats, ranges_m: Floats) -> None:
    rows[:, _LOG_SIZE + 1] = np.minimum(widths / 0.5, 4)
    rows[:, _LOG_SIZE + 2] = np.minimum(heights / 0.25, 4)
    rows[:, _LOG_SIZE + 3] = np.minimum(ranges_m / 50, 2)
