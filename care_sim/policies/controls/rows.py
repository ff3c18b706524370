"""A control: whole rows of the grid, without camera, tracks or memory."""

import numpy as np

from care_sim.base.checks import check_number
from care_sim.core.belief import Belief
from care_sim.core.grid import AngularGrid, Cells
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import Policy
from care_sim.policies.paper.history_uniform import GOLDEN

RING_ELEVATION_DEG = -1.25
"""Where the middle of a car 1.5 m high stands, 50 m away, for the default sensor, 1.84 m above the
road: atan((0.75 - 1.84) / 50). What enters the range of scoring by driving enters it there. It does
not follow the rig's `sensor_height_m`."""


class Rows(Policy):
    """Fires the rows nearest to the elevation at which things enter the range, nearest first; the
    last row is thinned evenly. Raises InvalidInput for an elevation that is none.
    """

    name = "rows"
    tags = ("causal", "control")
    source = "own: a pattern that never changes"
    is_pattern = True

    def __init__(self, rig: Rig, elevation_deg: float = RING_ELEVATION_DEG):
        super().__init__(rig)
        check_number("elevation_deg", elevation_deg, -90, 90)
        self._pattern = nearest_rows(rig.grid, elevation_deg)

    def demand(self, belief: Belief) -> Demand:
        """The same cells at every keyframe."""
        return Demand(layers=[[self._pattern[: belief.budget]]])


def nearest_rows(grid: AngularGrid, elevation_deg: float = RING_ELEVATION_DEG) -> Cells:
    """(N,) all cells, row after row, the row nearest to an elevation first; every first few cells
    of a row lie evenly over it.
    """
    rows = np.argsort(np.abs(np.rad2deg(grid.elevations) - elevation_deg), kind="stable")
    columns = np.argsort(np.arange(grid.columns) * GOLDEN % 1)
    cells: Cells = (rows[:, None] * grid.columns + columns).ravel()
    return cells
