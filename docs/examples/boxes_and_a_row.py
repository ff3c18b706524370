"""A rule of thirty lines, to hold a policy against: some cells of every camera box, then one row.

It has neither tracks nor the paper's idea, and remembers nothing:

    cd docs/examples
    care-sim protocol --policies history care boxes_and_a_row:BoxesAndARow full --budgets 0.01 0.03
"""

import numpy as np

import care_sim
from care_sim.core.residual import wedges

ENTERS_AT_DEG = -1.25
"""Elevation of the middle of a car 50 m ahead, where what drives comes into range."""


class BoxesAndARow(care_sim.Policy):
    """Fire at the middle of every camera box, then along one row, from straight ahead outwards."""

    # Cells of a box: one more than the returns with which the proxy detects.
    per_box = 4

    def __init__(self, rig):
        super().__init__(rig)
        directions = rig.grid.directions
        elevations = np.degrees(np.arcsin(directions[:, 2]))
        row = np.flatnonzero(
            np.isclose(elevations, elevations[np.abs(elevations - ENTERS_AT_DEG).argmin()])
        )
        self.row = row[np.argsort(-directions[row, 0], kind="stable")]

    def demand(self, belief):
        """Two layers: the boxes, then the row."""
        boxes = self.rig.listed(wedges(belief.detections, self.rig), "core-spread", self.per_box)
        return care_sim.Demand(layers=[boxes, [self.row]])


class SixteenAndARow(BoxesAndARow):
    """The same with sixteen cells of every box."""

    per_box = 16
