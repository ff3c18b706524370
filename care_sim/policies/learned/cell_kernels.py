"""What is seen of every cell, and its score by a network of one hidden layer, compiled.

`codes` (N,) hold the marks of cells, one a bit. Numba's cache notices a change in a compiled
function's own file only, so no other file's compiled code calls these.
"""

import math

import numpy as np

from care_sim.base.compiled import compiled

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


@compiled()
def mark_sets(codes, sizes, cells, ends, marks):  # type: ignore[no-untyped-def]
    """Give the cells of sets, which lie one after the other and end at `ends` (s,), the marks (s,)
    of their sets.

    `sizes` (N,) becomes, where there are UNEXPLAINED sets, log2 of the cells of the smallest over
    10; whether a cell is SMALL the smallest says too.
    """
    start = 0
    for n, end in enumerate(ends):
        size = np.float32(math.log2(end - start + 1) / 10)
        for cell in cells[start:end]:
            code = codes[cell]
            if not marks[n] & MARK_UNEXPLAINED:
                codes[cell] = code | marks[n]
            elif not code & MARK_UNEXPLAINED or size < sizes[cell]:
                codes[cell] = (code & ~MARK_SMALL) | marks[n]
                sizes[cell] = size
        start = end


@compiled()
def mark_scan(codes, nearnesses, ranges, heights, limits, margins):  # type: ignore[no-untyped-def]
    """Mark the cells that the last scan `ranges` (E, A) fired, what stood there, and its
    surroundings; write the `nearnesses` (N,) of returns, 1 at the sensor and 0 at the reach.

    `limits` are the reach and how high above the sensor a return must be to stand; it does in no
    hull. `heights` (N,) are those of unit rays, `margins` the columns and rows of the surroundings.
    """
    rows, columns = ranges.shape
    reach, clearance = limits
    aside, up = margins
    for row in range(rows):
        for column in range(columns):
            cell = row * columns + column
            distance = ranges[row, column]
            if distance <= 0:
                continue
            codes[cell] |= MARK_FIRED
            nearnesses[cell] = 1 - distance / reach
            if (
                distance < reach
                and heights[cell] * distance >= clearance
                and not codes[cell] & MARK_HULL
            ):
                codes[cell] |= MARK_STANDING
                for near in range(max(row - up, 0), min(row + up + 1, rows)):
                    for by in range(column - aside, column + aside + 1):
                        codes[near * columns + by % columns] |= MARK_NEAR_STANDING


@compiled()
def network_scores(seen, outlook, layers, out):  # type: ignore[no-untyped-def]
    """(N,) the output for every cell.

    `seen` are codes, sizes and nearnesses (N,); they enter the h units through `layers`: (256, h)
    by code, (h,) by size and (h,) by nearness. `outlook` is what else enters, (N, h), and (N,) the
    output of a cell without a mark. Units are rectified and weighed by `out` (h,).
    """
    codes, sizes, nearnesses = seen
    hidden, unseen = outlook
    by_code, by_size, by_nearness = layers
    scores = unseen.copy()
    units = np.empty_like(out)
    for n, code in enumerate(codes):
        if code:
            size = sizes[n]
            near = nearnesses[n]
            for h in range(len(out)):
                unit = hidden[n, h] + by_code[code, h] + size * by_size[h] + near * by_nearness[h]
                units[h] = max(unit, np.float32(0)) * out[h]
            scores[n] = units.sum()
    return scores
