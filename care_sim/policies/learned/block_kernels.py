"""Coarse pictures of the angular grid, compiled. Only marked or fired cells are touched, since most
cells of a keyframe are neither.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_sim.base.compiled import compiled
from care_sim.core.grid import Cells

BlockPictures = NDArray[np.float32]
"""(3, B) one number per block, for three pictures."""


class LastScan(NamedTuple):
    """The last scan, and the heights between which a return stands above the road."""

    ranges: NDArray[np.float32]
    """(N,) metres."""
    rises: NDArray[np.float64]
    """(N,) how far each ray rises per metre of range."""
    heights_m: NDArray[np.float64]
    """(N,) where each ray begins above the road."""
    reach_m: float
    lowest_m: float
    highest_m: float


@compiled()
def add_object_shares(
    sets: Cells, ends: Cells, blocks: Cells, marks: NDArray[np.uint8], out: BlockPictures
) -> None:
    """Add to `out` the share of each block's cells that lie in three groups of `sets`.

    The groups end at `ends` (3,). `blocks` (N,) is the block of every cell. `marks` (N,) is memory
    to work in; afterwards its bit g says whether a cell lies in group g.
    """
    # What one cell adds to the share of its block: blocks per cell.
    part = np.float32(out.shape[1] / len(blocks))
    marks[:] = 0
    start = 0
    for group, end in enumerate(ends):
        for cell in sets[start:end]:
            # Sets of a group overlap; a cell counts once per group.
            if not marks[cell] >> group & 1:
                marks[cell] |= 1 << group
                out[group, blocks[cell]] += part
        start = end


@compiled()
def add_returns(
    fired: Cells, scan: LastScan, blocks: Cells, marks: NDArray[np.uint8], out: BlockPictures
) -> None:
    """Fill `out` from the cells that fired: the nearness of each block's nearest return, the share
    of its cells that fired, and the share of those with a return that stands above the road outside
    every hull. The hulls are the first group of `marks`.
    """
    part = np.float32(out.shape[1] / len(blocks))
    for cell in fired:
        block = blocks[cell]
        distance = scan.ranges[cell]
        out[1, block] += part
        # A ray without a return reads the reach.
        if distance < scan.reach_m:
            out[0, block] = max(out[0, block], np.float32(1 - distance / scan.reach_m))
            height = scan.heights_m[cell] + distance * scan.rises[cell]
            if not marks[cell] & 1 and scan.lowest_m < height < scan.highest_m:
                out[2, block] += part
