"""What is seen of every cell, and its score by a network of one hidden layer, compiled.

`codes` (N,) hold the marks of cells, one per bit.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_sim.base.compiled import compiled
from care_sim.core.grid import Cells

Codes = NDArray[np.uint8]
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
    """What a return must be to stand above the road, and how far its surroundings reach."""

    reach_m: np.float32
    """The longest range; a ray that returns nothing reads it."""
    clearance_m: np.float32
    """How high above the sensor a return must be."""
    margin_columns: int
    margin_rows: int
    turn: int
    """How many columns a whole turn has; the grid may have fewer."""


class RigTerms(NamedTuple):
    """What enters the network and stays the same while the rig does."""

    hidden: CellNumbers
    """(N, h) what enters the hidden units."""
    unmarked: CellNumbers
    """(N,) the output of a cell without a mark."""


class MarkWeights(NamedTuple):
    """The weights into the hidden units of what a keyframe shows."""

    by_code: CellNumbers
    """(256, h) for every code of marks."""
    by_size: CellNumbers
    """(h,)"""
    by_nearness: CellNumbers
    """(h,)"""


@compiled()
def mark_sets(codes: Codes, sizes: CellNumbers, cells: Cells, ends: Cells, marks: Codes) -> None:
    """Give the cells of sets the marks (s,) of their sets.

    The sets lie one after the other in `cells` and end at `ends` (s,). `sizes` (N,) becomes log2 of
    the cells of the smallest MARK_UNEXPLAINED set that a cell lies in, over 10. That set also
    decides whether the cell is MARK_SMALL.
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
                # The smaller set replaces what the larger one said of its class.
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
    """Mark the cells that the last scan `ranges` (E, A) fired, what stood there, and its
    surroundings. Write the `nearnesses` (N,) of returns, 1 at the sensor and 0 at the reach.

    `heights` (N,) are those of unit rays. Nothing in a hull counts as standing, since its track
    explains it: hulls are marked before the scan.
    """
    rows, columns = ranges.shape
    for row in range(rows):
        for column in range(columns):
            cell = row * columns + column
            distance = ranges[row, column]
            if distance <= 0:
                continue
            # A ray without a return reads the reach, and so has the nearness 0.
            codes[cell] |= MARK_FIRED
            nearnesses[cell] = 1 - distance / rules.reach_m
            if (
                distance < rules.reach_m
                and heights[cell] * distance >= rules.clearance_m
                and not codes[cell] & MARK_HULL
            ):
                codes[cell] |= MARK_STANDING
                # Columns go round the car, where the grid does; rows end at top and bottom.
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
    """(N,) the output of the network for every cell.

    `codes`, `sizes` and `nearnesses` (N,) are what a keyframe shows. Hidden units are rectified and
    weighed by `out` (h,).
    """
    scores = rig.unmarked.copy()
    units = np.empty_like(out)
    for n, code in enumerate(codes):
        # Most cells have no mark: theirs is the output that was computed with the rig.
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
            # One sum over all units, in NumPy's order: published scores hang on it.
            scores[n] = units.sum()
    return scores
