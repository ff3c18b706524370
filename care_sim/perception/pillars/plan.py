"""The plan round the sensor: which pillar each point stands in, and what is told of it there."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_sim.core.arrays import Floats

PILLAR_M = 0.5
"""The side of a pillar: a person covers one, a car some thirty."""
PILLARS = 208
"""Along each side of the plan, the sensor in its middle: 52 m each way, a range of 50 m and half a
car. It can be halved four times."""
CELL_M = 2 * PILLAR_M
"""The side of a cell in which the network answers."""
CELLS = PILLARS // 2
REACH_M = PILLAR_M * PILLARS / 2
OWN_ROOF_M = 2.0
"""Nearer to the sensor than this there is the roof that carries it."""
LOWEST_M, HIGHEST_M = -1.0, 4.5
"""Heights above the road between which points count: a road that falls away, and the highest bus.
"""
POINT_INPUTS = ("dx", "dy", "height", "low", "range", "cos", "sin", "z")
"""What is told of a point: its place in its pillar (sides at -1 and 1); its height above the road,
metres; the same up to 0.5 m, twice over, since a kerb differs from a foot by little; its planar
range over REACH_M; cosine and sine of its bearing; z in the sensor frame, metres."""
_LOW_M = 0.5


class Points(NamedTuple):
    """Points of the plan: `inputs` (p, len(POINT_INPUTS)) float32, `pillars` (p,) the index of the
    pillar that each stands in, row (x) by row.
    """

    inputs: NDArray[np.float32]
    pillars: NDArray[np.int64]


def on_plan(points: Floats, sensor_height_m: float) -> Points:
    """What the network is told of points (P, 3) in the sensor frame; those off the plan are left
    out.
    """
    x, y, z = points[:, :3].T
    height = z + sensor_height_m
    ranges = np.hypot(x, y)
    kept = (np.maximum(np.abs(x), np.abs(y)) < REACH_M) & (ranges > OWN_ROOF_M)
    kept &= (height > LOWEST_M) & (height < HIGHEST_M)
    x, y, z, height, ranges = (column[kept] for column in (x, y, z, height, ranges))

    places = (np.stack([x, y]) + REACH_M) / PILLAR_M
    # The last bits of a sum may lift a place to the far edge.
    rows, columns = np.minimum(places.astype(np.int64), PILLARS - 1)
    within = 2 * (places - [rows, columns]) - 1
    low = np.minimum(height, _LOW_M) / _LOW_M
    told = (*within, height, low, ranges / REACH_M, x / ranges, y / ranges, z)
    return Points(np.stack(told, axis=1).astype(np.float32), rows * PILLARS + columns)


def cell_centres() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The middle of every cell, x (CELLS, 1) and y (1, CELLS), metres in the sensor frame."""
    along = ((np.arange(CELLS) + 0.5) * CELL_M - REACH_M).astype(np.float32)
    return along[:, None], along[None, :]
