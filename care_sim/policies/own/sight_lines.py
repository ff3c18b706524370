"""Where something new can come into view: along lines of sight that are open, and at the edges of
what hides.
"""

import numpy as np

from care_sim.core.belief import Belief
from care_sim.core.grid import Cells
from care_sim.core.rig import Rig

OPEN_M = 25.0
"""A line of sight is open if nothing was met nearer than this, half the range of scoring."""
EDGE_M = 5.0
"""Two neighbouring columns lie on either side of an edge if their ranges differ by more: about the
length of a car, behind which another thing has room."""
EDGE_COLUMNS = 4
"""Columns to either side of an edge that are watched: 2.8 degrees, 1.5 m at a range of 30 m, what a
walker covers in a second and a car in a tenth."""


class SightLines:
    """A memory of the last range in every column of one `row`, turned with the car.

    What drives into the range enters it at the end of an open line of sight; what was hidden shows
    itself at an edge. A line that was never fired counts as open.
    """

    def __init__(self, rig: Rig, row: int):
        self._rig = rig
        self._row = row
        self._ranges = np.full(rig.grid.columns, rig.grid.range_m)
        self._turned = 0.0

    def update(self, belief: Belief) -> None:
        """Take in the last scan, and turn by what the car has turned since."""
        seen = belief.ranges[self._row]
        self._ranges[seen > 0] = seen[seen > 0]

        # The car turns to the left, so what stands still goes to the right, to lower columns. What
        # is left of a whole column is kept for the next keyframe.
        self._turned += belief.ego.yaw_rate * self._rig.keyframe_s / self._rig.grid.column_width
        columns = round(self._turned)
        self._ranges = np.roll(self._ranges, -columns)
        self._turned -= columns

    def cells(self) -> Cells:
        """The cells of the row that are worth a look, ascending."""
        watched = self._ranges >= OPEN_M
        # Edge c lies between columns c and c + 1.
        edges = np.abs(self._ranges - np.roll(self._ranges, -1)) > EDGE_M
        for shift in range(-EDGE_COLUMNS + 1, EDGE_COLUMNS + 1):
            watched |= np.roll(edges, shift)
        cells: Cells = self._row * self._rig.grid.columns + np.flatnonzero(watched)
        return cells
