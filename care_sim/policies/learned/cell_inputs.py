"""Features of every cell before it fires: the numbers that a learned scorer reads."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Mask
from care_sim.core.belief import Belief
from care_sim.core.cells.sets import CellSets
from care_sim.core.grid import Cells
from care_sim.core.residual import explained, wedges
from care_sim.core.rig import Rig
from care_sim.core.types import CLASSES
from care_sim.policies.paper.tracks import GROUND_CLEARANCE_M

Codes = NDArray[np.uint8]
"""(N,) the marks of cells, one per bit."""
CellNumbers = NDArray[np.float32]

(
    MARK_UNEXPLAINED,
    MARK_BOX,
    MARK_SMALL,
    MARK_EXPLAINED,
    MARK_HULL,
    MARK_FIRED,
    MARK_STANDING,
    MARK_NEAR_STANDING,
) = (1 << bit for bit in range(8))


class ScanRules(NamedTuple):
    """Rules by which a return counts as above the road, and how far its surroundings reach."""

    reach_m: np.float32
    """The longest range, which a ray without a return reads."""
    clearance_m: np.float32
    """Least height of a return above the sensor."""
    margin_columns: int
    margin_rows: int
    turn: int
    """Columns of a whole turn; the grid may have fewer."""


class RigTerms(NamedTuple):
    """Inputs of the network that stay the same while the rig does."""

    hidden: CellNumbers
    """(N, h) inputs of the hidden units."""
    unmarked: CellNumbers
    """(N,) the output of a cell without a mark."""


class MarkWeights(NamedTuple):
    """The weights from a keyframe's inputs to the hidden units."""

    by_code: CellNumbers
    """(256, h) for every code of marks."""
    by_size: CellNumbers
    """(h,)"""
    by_nearness: CellNumbers
    """(h,)"""


@compiled()
def mark_sets(codes: Codes, sizes: CellNumbers, cells: Cells, ends: Cells, marks: Codes) -> None:
    """Give the cells of sets the marks (s,) of their sets.

    The sets are concatenated in `cells` and end at `ends` (s,). `sizes` (N,) becomes log2 of the
    number of cells, over 10, of a cell's smallest MARK_UNEXPLAINED set. That set also decides
    whether the cell is MARK_SMALL.
    """
    start = 0
    for n, end in enumerate(ends):
        size = np.float32(math.log2(end - start + 1) / 10)
        for cell in cells[start:end]:
            code = codes[cell]
            # Only unexplained sets compete for a cell; all other marks add up.
            if not marks[n] & MARK_UNEXPLAINED:
                codes[cell] = code | marks[n]
            elif not code & MARK_UNEXPLAINED or size < sizes[cell]:
                # The smaller set overrides the class mark of the larger one.
                codes[cell] = (code & ~MARK_SMALL) | marks[n]
                sizes[cell] = size
        start = end


@compiled()
def mark_scan(
    codes: Codes,
    nearnesses: CellNumbers,
    ranges: CellNumbers,
    heights: CellNumbers,
    rules: ScanRules,
) -> None:
    """Mark the cells that the last scan `ranges` (E, A) fired, standing returns, and their
    surroundings. Write the `nearnesses` (N,) of returns, 1 at the sensor and 0 at the reach.

    `heights` (N,) are those of unit rays. Returns in a hull do not count as standing, since its
    track explains them: hulls are marked before the scan.
    """
    rows, columns = ranges.shape
    for row in range(rows):
        for column in range(columns):
            cell = row * columns + column
            distance = ranges[row, column]
            if distance <= 0:
                continue
            # A ray without a return reads the reach, so its nearness is 0.
            codes[cell] |= MARK_FIRED
            nearnesses[cell] = 1 - distance / rules.reach_m
            if (
                distance < rules.reach_m
                and heights[cell] * distance >= rules.clearance_m
                and not codes[cell] & MARK_HULL
            ):
                codes[cell] |= MARK_STANDING
                # Columns wrap around if the grid does; rows end at top and bottom.
                first = max(row - rules.margin_rows, 0)
                last = min(row + rules.margin_rows + 1, rows)
                for near in range(first, last):
                    for by in range(
                        column - rules.margin_columns, column + rules.margin_columns + 1
                    ):
                        if by % rules.turn < columns:
                            codes[near * columns + by % rules.turn] |= MARK_NEAR_STANDING


@compiled()
def network_scores(
    codes: Codes,
    sizes: CellNumbers,
    nearnesses: CellNumbers,
    rig: RigTerms,
    weights: MarkWeights,
    out: CellNumbers,
) -> CellNumbers:
    """Return (N,) the output of the network for every cell.

    `codes`, `sizes` and `nearnesses` (N,) are the keyframe's inputs. Hidden units are rectified and
    weighted by `out` (h,).
    """
    scores = rig.unmarked.copy()
    units = np.empty_like(out)
    for n, code in enumerate(codes):
        # Most cells have no mark: their output was computed with the rig.
        if code:
            size = sizes[n]
            near = nearnesses[n]
            for h in range(len(out)):
                unit = (
                    rig.hidden[n, h]
                    + weights.by_code[code, h]
                    + size * weights.by_size[h]
                    + near * weights.by_nearness[h]
                )
                units[h] = max(unit, np.float32(0)) * out[h]
            # One sum over all units, in NumPy's order: published scores depend on it.
            scores[n] = units.sum()
    return scores


CELL_MARKS = (
    "in the wedge of a camera detection that no forecast explains",
    "in that wedge before it is dilated",
    "in such a wedge of a pedestrian or bicycle; of several wedges the smallest counts",
    "in the wedge of a camera detection that a forecast explains",
    "in the hull of a forecast",
    "fired by the last scan",
    "returned by it from above the road, and in no hull",
    "within the margins of such a cell",
)
"""Marks of a cell at a keyframe: the bits of its code, the lowest first."""
SCAN_INPUTS = len(CELL_MARKS) + 2
"""Inputs per keyframe: the marks; log2 of the unexplained wedge's cells over 10; nearness of the
last return, 1 at the sensor, 0 at the reach and without a return.
"""
RIG_INPUTS = (
    "elevation over half a radian",
    "nearness of the road",
    "cos azimuth",
    "abs sin azimuth",
    "in a picture",
)
"""Inputs of a cell that depend only on the rig. Left and right are symmetric, so that 20 scenes
teach no side.
"""

_SMALL_CLASSES = np.isin(CLASSES, ("pedestrian", "bicycle"))

Float32s = NDArray[np.float32]


class CellFeatures(NamedTuple):
    """Features of all cells: `codes` (N,) of `CELL_MARKS`, `sizes` (N,) and `nearnesses` (N,) as in
    `SCAN_INPUTS`.
    """

    codes: NDArray[np.uint8]
    sizes: Float32s
    nearnesses: Float32s

    def rows(self, cells: Cells) -> Float32s:
        """Return (n, `SCAN_INPUTS`) of some cells (n,)."""
        marks = np.unpackbits(self.codes[cells, None], axis=1, bitorder="little")
        return np.column_stack([marks, self.sizes[cells], self.nearnesses[cells]]).astype(
            np.float32
        )


class CellInputs:
    """The inputs of a rig's cells, N of them in the order of their index."""

    def __init__(self, rig: Rig):
        self.rig = rig
        # The same task without margins, whose wedges are those of the boxes themselves.
        self._undilated = replace(rig, azimuth_margin=0, elevation_margin=0)
        self._heights = rig.grid.directions[:, 2].astype(np.float32)

    def of(self, belief: Belief, hulls: Sequence[Cells]) -> CellFeatures:
        """Return the features of all cells at a keyframe, given the hulls of its forecasts."""
        rig = self.rig
        cells = self.rig.grid.size
        seen = CellFeatures(
            np.zeros(cells, np.uint8), np.zeros(cells, np.float32), np.zeros(cells, np.float32)
        )
        # Sets first: a return in a hull does not count as standing.
        mark_sets(seen.codes, seen.sizes, *self._sets(belief, hulls))
        for head in rig.grid.heads:
            rules = ScanRules(
                np.float32(rig.grid.range_m),
                np.float32(GROUND_CLEARANCE_M - (rig.sensor_height_m + head.place[2])),
                rig.azimuth_margin,
                rig.elevation_margin,
                head.grid.turn,
            )
            own, (first, last) = head.cells, head.rows
            ranges = belief.ranges[first : last + 1]
            mark_scan(seen.codes[own], seen.nearnesses[own], ranges, self._heights[own], rules)
        return seen

    @cached_property
    def rig_inputs(self) -> Float32s:
        """Return (N, `RIG_INPUTS`) the inputs of every cell that need no keyframe."""
        grid = self.rig.grid
        x, y, z = grid.directions.T
        flat = np.hypot(x, y)
        # Range at which a ray meets a level road, if it falls.
        height = self.rig.sensor_height_m + grid.origins_of(np.arange(grid.size))[..., 2]
        road = np.divide(height, -z, out=np.full(len(z), np.inf), where=z < 0)
        ground = 1 - np.minimum(road / grid.range_m, 1)
        return np.stack(
            [np.arcsin(z) / 0.5, ground, x / flat, np.abs(y) / flat, self._covered()], 1
        ).astype(np.float32)

    def _sets(
        self, belief: Belief, hulls: Sequence[Cells]
    ) -> tuple[Cells, Cells, NDArray[np.uint8]]:
        """Return the concatenated cells of hulls, wedges and undilated wedges, the end of each set,
        and its marks. The order of the three is that of the marks below.
        """
        detections = belief.detections
        known = explained(detections, belief.tracks, self.rig)
        dilated, bare = (wedges(detections, rig) for rig in (self.rig, self._undilated))
        sets = CellSets.joined([CellSets.of(hulls), dilated, bare])
        new = MARK_UNEXPLAINED + MARK_SMALL * _SMALL_CLASSES[detections.classes]
        marks = np.concatenate(
            [
                np.full(len(hulls), MARK_HULL),
                np.where(known, MARK_EXPLAINED, new),
                np.where(known, 0, MARK_BOX),
            ]
        )
        return sets.cells, np.cumsum(sets.sizes), marks.astype(np.uint8)

    def _covered(self) -> Mask:
        """Return (N,) whether the end of a cell's ray lies in a picture. At that range the offset
        of a camera from the LiDAR does not matter.
        """
        grid = self.rig.grid
        covered = np.zeros(grid.size, bool)
        ends = grid.points(np.arange(grid.size), np.full(grid.size, grid.range_m))
        for camera in self.rig.cameras:
            pixels, _ = camera.project(ends)
            covered |= ((pixels >= 0) & (pixels <= (camera.width, camera.height))).all(axis=1)
        return covered
