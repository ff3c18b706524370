"""Statistics of sets of cells, and the choice of cells by gain, compiled."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers
from care_sim.core.grid import Cells

Numbers = NDArray[np.float32]

IN_HULL, IN_WEDGE = np.uint8(1), np.uint8(2)
"""Marks of a cell."""


@compiled()
def covered_shares(
    hulls: Cells,
    hull_sizes: Integers,
    wedges: Cells,
    wedge_sizes: Integers,
    marks: NDArray[np.uint8],
) -> Numbers:
    """Return (w + h,) the share of every wedge's cells that lie in a hull, then of every hull's in
    nearer hulls before it. `marks` (N,), zeros before, are filled.
    """
    shares = np.zeros(len(wedge_sizes) + len(hull_sizes), np.float32)
    start = 0
    for n, size in enumerate(hull_sizes):
        own = hulls[start : start + size]
        shares[len(wedge_sizes) + n] = _marked(own, marks) / max(size, 1)
        for cell in own:
            marks[cell] |= IN_HULL
        start += size
    start = 0
    for n, size in enumerate(wedge_sizes):
        shares[n] = _marked(wedges[start : start + size], marks) / max(size, 1)
        start += size
    for cell in wedges:
        marks[cell] |= IN_WEDGE
    return shares


@compiled()
def _marked(cells: Cells, marks: NDArray[np.uint8]) -> int:
    count = 0
    for cell in cells:
        count += marks[cell] & IN_HULL
    return count


@compiled()
def look_back(
    cells: Cells, sizes: Integers, ranges: Numbers, road: Floats, reach: float, first: int
) -> Numbers:
    """Return (n, 4) statistics of the last scan `ranges` (N,) over the first cells of every set.
    First the fired share, then the share of these with a return. Then the mean nearness of returns,
    1 at the sensor and 0 at the `reach`, and the share of returns above the road. Rays meet the
    road at `road` (N,) metres.
    """
    told = np.zeros((len(sizes), 4), np.float32)
    start = 0
    for n, size in enumerate(sizes):
        fired = returned = standing = 0
        nearness = 0.0
        for cell in cells[start : start + min(size, first)]:
            if ranges[cell] > 0:
                fired += 1
                if ranges[cell] < reach:
                    returned += 1
                    nearness += 1 - ranges[cell] / reach
                    standing += ranges[cell] < road[cell]
        told[n, 0] = fired / max(min(size, first), 1)
        told[n, 1] = returned / max(fired, 1)
        told[n, 2] = nearness / max(returned, 1)
        told[n, 3] = standing / max(returned, 1)
        start += size
    return told


@compiled()
def look_at_strips(
    strips: NDArray[np.int64],
    ranges: Numbers,
    road: Floats,
    reach: float,
    marks: NDArray[np.uint8],
    told: Numbers,
) -> None:
    """Fill the first columns of `told` (S, 6 or more) per strip. First the shares of its cells in
    hulls and in wedges, by their `marks` (N,), then the result of `look_back`.
    """
    count, size = strips.shape
    told[:, 2:6] = look_back(strips.ravel(), np.full(count, size), ranges, road, reach, size)
    for n in range(count):
        for mark, column in ((IN_HULL, 0), (IN_WEDGE, 1)):
            marked = 0
            for cell in strips[n]:
                marked += (marks[cell] & mark) > 0
            told[n, column] = marked / size


class _Pieces(NamedTuple):
    """Pieces of sets (p,): the gain per cell, and the begin and end of each in all cells. Pieces of
    strips come after all cells.
    """

    rates: Numbers
    begins: Integers
    ends: Integers


@compiled()
def best_cells(
    cells: Cells,
    sizes: Integers,
    steps: Integers,
    gains: Numbers,
    strips: NDArray[np.int64],
    strip_gains: Numbers,
    budget: int,
    taken: NDArray[np.bool_],
) -> Cells:
    """Return the cells (n,), at most `budget`, that gain most per cell, in order of selection.

    The first `steps[k]` (K,) cells of set i are together worth `gains[i, k]` (n, K). All cells of
    strip s, `strips[s]` (S, c), are worth `strip_gains[s]` (S,). Gains need not be concave: a set
    is served in pieces, along the least concave curve above its gains. Pieces of most gain per cell
    then come first, and pieces of a set in order. `taken` (N,), all False before, marks the chosen
    cells.
    """
    most = len(sizes) * len(steps) + len(strips)
    pieces = _Pieces(np.empty(most, np.float32), np.empty(most, np.int64), np.empty(most, np.int64))
    count = start = 0
    for n, size in enumerate(sizes):
        count = _cut(gains[n], steps, start, size, pieces, count)
        start += size
    every = np.concatenate((cells, strips.ravel()))
    for n in range(len(strips)):
        pieces.rates[count] = strip_gains[n] / np.float32(strips.shape[1])
        pieces.begins[count] = start + n * strips.shape[1]
        pieces.ends[count] = pieces.begins[count] + strips.shape[1]
        count += 1

    # Take the first of equal pieces: the result does not depend on the machine's sort.
    chosen = np.empty(budget, np.int64)
    found = 0
    for piece in np.argsort(-pieces.rates[:count], kind="mergesort"):
        for cell in every[pieces.begins[piece] : pieces.ends[piece]]:
            if found < budget and not taken[cell]:
                taken[cell] = True
                chosen[found] = cell
                found += 1
        if found == budget:
            break
    return chosen[:found]


@compiled()
def _cut(
    gains: Numbers, steps: Integers, start: int, size: int, pieces: _Pieces, count: int
) -> int:
    """Add the pieces of one set of `size` cells, the first at `start`, to the `count` pieces.
    Returns the new count.
    """
    done = 0
    gained = np.float32(0)
    while done < size:
        best, corner = _next_corner(gains, steps, done, size, gained)
        if corner < 0:
            break
        last = min(steps[corner], size)
        pieces.rates[count] = best
        pieces.begins[count], pieces.ends[count] = start + done, start + last
        count += 1
        done, gained = last, gains[corner]
    return count


@compiled()
def _next_corner(
    gains: Numbers, steps: Integers, done: int, size: int, gained: np.float32
) -> tuple[np.float32, int]:
    """Return the step with the largest gain per cell after `done` cells with `gained`, and that
    gain; -1 without a gain.
    """
    best = np.float32(0)
    corner = -1
    for k, step in enumerate(steps):
        last = min(step, size)
        if last > done:
            rate = (gains[k] - gained) / np.float32(last - done)
            if rate > best:
                best, corner = rate, k
        if step >= size:
            break
    return best, corner


@compiled()
def needed_cells(
    cells: Cells, sizes: Integers, behind: Integers, objects: int, min_returns: int
) -> NDArray[np.int64]:
    """Return (n, objects) the number of cells of every set after which an object has `min_returns`,
    0 if never. `behind` (N,) is the object, from 0, that each cell would return from, -1 for none.
    """
    needed = np.zeros((len(sizes), objects), np.int64)
    start = 0
    for n, size in enumerate(sizes):
        returns = np.zeros(objects, np.int64)
        for place in range(size):
            number = behind[cells[start + place]]
            if number >= 0:
                returns[number] += 1
                if returns[number] == min_returns:
                    needed[n, number] = place + 1
        start += size
    return needed
