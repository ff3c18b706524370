"""Pictures of the angular grid drawn coarse, compiled: only cells that are marked or fired are
touched.

Numba's cache notices a change in a compiled function's own file only, so no other file's compiled
code calls these.
"""

import numpy as np

from care_sim.base.compiled import compiled


@compiled()
def add_object_shares(sets, ends, blocks, marks, out):  # type: ignore[no-untyped-def]
    """Add to `out` (3, B) a part for every cell of three groups of `sets`, a cell counting once a
    group.

    The groups end at `ends` (3,). `blocks` (N,) is the block of every cell, `marks` (N,) uint8 is
    for scribbling.
    """
    part = np.float32(out.shape[1] / len(blocks))
    marks[:] = 0
    start = 0
    for group, end in enumerate(ends):
        for cell in sets[start:end]:
            if not marks[cell] >> group & 1:
                marks[cell] |= 1 << group
                out[group, blocks[cell]] += part
        start = end


@compiled()
def add_returns(fired, scan, blocks, marks, out):  # type: ignore[no-untyped-def]
    """Fill `out` (3, B) from the cells that fired: the nearness of the nearest return, and the
    shares of cells fired and of those with a return that stands above the road outside every hull,
    which `marks` has as its first group.

    `scan` are ranges (N,), how far each ray rises a metre (N,), the reach, the sensor's height, and
    the lowest and the highest that stands above the road.
    """
    ranges, rises, reach, sensor, lowest, highest = scan
    part = np.float32(out.shape[1] / len(blocks))
    for cell in fired:
        block = blocks[cell]
        distance = ranges[cell]
        out[1, block] += part
        if distance < reach:
            out[0, block] = max(out[0, block], np.float32(1 - distance / reach))
            if not marks[cell] & 1 and lowest < sensor + distance * rises[cell] < highest:
                out[2, block] += part
