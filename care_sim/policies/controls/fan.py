"""A control: a fan straight ahead, without camera, tracks or memory."""

import numpy as np

from care_sim.base.checks import check_whole
from care_sim.core.grid import Cells
from care_sim.core.grid_stack import Grid
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import FixedPolicy

LOWEST_DEG = -10.7
"""The fan reaches from the horizon down to here. The lowest row of the default grid above it, at
-10.67 degrees, meets the road 9.8 m away from the default sensor, 1.84 m above it. It does not
follow the rig's `sensor_height_m`."""


class Fan(FixedPolicy):
    """Fires what lies ahead, between the horizon and `LOWEST_DEG`, the columns nearest to straight
    ahead first: at 3% of the paper's grid 20 degrees to either side. When the fan has gone all
    round, the other rows follow in the same way. Several LiDARs make one fan.

    With `shots` it asks for as many times fewer cells, each of which hardware that fires cells
    several times then fires as often. Raises InvalidInput for less than one.
    """

    name = "fan"
    tags = ("causal", "control")
    source = "own: a pattern that never changes"
    is_pattern = True

    def __init__(self, rig: Rig, shots: int = 1):
        super().__init__(rig)
        check_whole("shots", shots, 1)
        self._shots = shots
        self._pattern = np.concatenate([fanned(rig.grid, is_low) for is_low in (True, False)])

    def fixed(self, budget: int) -> Demand:
        """The same cells at every keyframe."""
        return Demand(layers=[[self._pattern[: budget // self._shots]]])


def fanned(grid: Grid, is_low: bool) -> Cells:
    """The cells between the horizon and `LOWEST_DEG`, or all others, the columns nearest to
    straight ahead first.
    """
    columns, off_ahead = [], []
    for head in grid.heads:
        own = head.grid
        elevations = own.elevations_ahead
        low = (elevations < own.row_height / 2) & (elevations > np.deg2rad(LOWEST_DEG))
        rows = head.first + np.flatnonzero(low == is_low) * own.columns
        columns += [rows + column for column in range(own.columns)]
        # In columns of the first LiDAR, whose own are whole ones and a half.
        off_ahead.append(own.from_ahead * (own.column_width / grid.heads[0].grid.column_width))
    nearest = np.argsort(np.concatenate(off_ahead), kind="stable")
    return np.concatenate([columns[place] for place in nearest])
