"""A rolling sweep: columns fire one after another, while ego and bodies move on.

A spinning sensor turns clockwise, as seen from above, from behind the car to behind it (Velodyne,
HDL-32E manual). The sweep ends at the keyframe: what it returns is as old as its column, and
nothing is known of what comes after.
"""

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.cells.stack import Grid
from care_sim.core.grid import Cells

MOST_INSTANTS = 64
"""Columns share an instant with their neighbours, 64 in a sweep. In 0.1 s and 512 columns that is
0.7 ms from their own at the most, in which 30 m/s are 2 cm.
"""


class RollingSweep:
    """The instants at which the columns of a grid fire in a sweep of `sweep_s` seconds."""

    def __init__(self, grid: Grid, sweep_s: float):
        self._columns = grid.columns
        # The last columns come first: azimuths grow to the left, and the sensor turns to the right.
        columns = np.arange(grid.columns)
        own = -sweep_s * (columns + 0.5) / grid.columns
        self._group_of: Integers = columns * min(MOST_INSTANTS, grid.columns) // grid.columns
        # A group fires at the mean instant of its columns.
        self._seconds = np.bincount(self._group_of, own) / np.bincount(self._group_of)

    def instants(self, cells: Cells) -> list[tuple[float, Integers]]:
        """The instants at which some of `cells` (n,) fire, in seconds from the keyframe, below 0,
        and the places among `cells` of those that do.
        """
        groups = self._group_of[cells % self._columns]
        found = np.unique(groups).tolist()
        return [(float(self._seconds[one]), np.flatnonzero(groups == one)) for one in found]

    def seconds(self, cells: Cells) -> Floats:
        """(n,) when each of `cells` fires, seconds from the keyframe."""
        return self._seconds[self._group_of[cells % self._columns]]
