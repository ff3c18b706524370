"""The sector ahead, in which what the car drives towards enters the range of scoring."""

import math

import numpy as np

from care_sim.core.grid import Cells
from care_sim.core.grid_stack import Grid

AHEAD_RAD = math.atan(13 / 50)
"""Half of the sector: at the range of scoring, 50 m, a street of 26 m from house to house, with two
lanes, parked cars and pavements."""


def columns_ahead(grid: Grid) -> Cells:
    """(n,) the columns whose middle lies within `AHEAD_RAD` of straight ahead, the nearest to it
    first; none on a grid whose columns are wider than that. Of several LiDARs those of the second
    are numbered on from those of the first.
    """
    off_ahead = np.abs(np.concatenate([head.grid.azimuths for head in grid.heads]))
    nearest_first = np.argsort(off_ahead, kind="stable")
    columns: Cells = nearest_first[off_ahead[nearest_first] <= AHEAD_RAD]
    return columns
