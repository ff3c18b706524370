"""Coarse pictures of the angular grid, compiled. Only marked or fired cells are touched, since most
cells of a keyframe are neither.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Integers
from care_sim.core.grid import Cells

BlockPictures = NDArray[np.float32]
"""(k, B) one number per block, for k pictures."""


class AboveRoad(NamedTuple):
    """What tells how far above the road a ray ends, and between which heights a return stands."""

    rises: NDArray[np.float64]
    """(N,) how far each ray rises per metre of range."""
    heights_m: NDArray[np.float64]
    """(N,) where each ray begins above the road."""
    reach_m: float
    lowest_m: float
    highest_m: float


@compiled()
def draw_pictures(
    cells: Cells,
    sizes: Integers,
    counts: Integers,
    scans: NDArray[np.float32],
    above: AboveRoad,
    blocks: Cells,
    marks: NDArray[np.uint8],
    out: NDArray[np.float32],
) -> None:
    """Fill `out` (W, 6, B), zeros before, with the six pictures of W worlds: of objects, and of
    their last `scans` (W, N) in metres.

    The objects are sets of so many `sizes`, one after the other in `cells`, in three groups: those
    of the first group, of which `counts[0, w]` are of world w, world after world, then the other
    two. `blocks` (N,) is the block of every cell, `marks` (N,) memory to work in.
    """
    ends = np.cumsum(sizes)
    firsts = counts.sum(axis=1)
    firsts = np.cumsum(firsts) - firsts
    for world in range(len(out)):
        marks[:] = 0
        for group in range(len(counts)):
            last = firsts[group] + counts[group, world]
            for n in range(firsts[group], last):
                own = cells[ends[n] - sizes[n] : ends[n]]
                _add_object(own, group, blocks, marks, out[world])
            firsts[group] = last
        _add_returns(scans[world], above, blocks, marks, out[world, 3:])


@compiled()
def _add_object(
    cells: Cells, group: int, blocks: Cells, marks: NDArray[np.uint8], out: BlockPictures
) -> None:
    """Add to `out[group]` the share of each block's cells that are among `cells` and are not in the
    group yet: bit g of a cell's mark says whether it is in group g.
    """
    # What one cell adds to the share of its block: blocks per cell.
    part = np.float32(out.shape[1] / len(blocks))
    for cell in cells:
        # Sets of a group overlap; a cell counts once per group.
        if not marks[cell] >> group & 1:
            marks[cell] |= 1 << group
            out[group, blocks[cell]] += part


@compiled()
def _add_returns(
    ranges: NDArray[np.float32],
    above: AboveRoad,
    blocks: Cells,
    marks: NDArray[np.uint8],
    out: BlockPictures,
) -> None:
    """Fill `out` from a scan (N,): the nearness of each block's nearest return, the share of its
    cells that fired, and the share of those with a return that stands above the road outside every
    hull. The hulls are the first group of `marks`.
    """
    part = np.float32(out.shape[1] / len(blocks))
    for cell in range(len(ranges)):
        distance = ranges[cell]
        # A cell that did not fire reads 0.
        if not distance > 0:
            continue
        block = blocks[cell]
        out[1, block] += part
        # A ray without a return reads the reach.
        if distance < above.reach_m:
            out[0, block] = max(out[0, block], np.float32(1 - distance / above.reach_m))
            height = above.heights_m[cell] + distance * above.rises[cell]
            if not marks[cell] & 1 and above.lowest_m < height < above.highest_m:
                out[2, block] += part
