"""A control: whole rows of the grid, without camera, tracks or memory."""

import math

import numpy as np

from care_sim.base.checks import check_number, check_whole
from care_sim.core.grid import Cells, Head
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import FixedPolicy
from care_sim.policies.paper.history_uniform import GOLDEN

ENTRY_HEIGHT_M = 0.75
"""Of the middle of a car 1.5 m high above the road."""
ENTRY_DISTANCE_M = 50.0
"""The range of scoring: what enters it by driving enters it there."""


class Rows(FixedPolicy):
    """Fires the rows nearest to the elevation at which things enter the range, nearest first; the
    last row is thinned evenly. That elevation follows from the rig (`entry_elevation_deg`), unless
    one is given. `shots` are as of `care_sim.policies.controls.fan`. Raises InvalidInput for an
    elevation that is none, and for less than one shot.
    """

    name = "rows"
    tags = ("causal", "control")
    source = "own: a pattern that never changes"
    is_pattern = True

    def __init__(self, rig: Rig, elevation_deg: float | None = None, shots: int = 1):
        super().__init__(rig)
        check_whole("shots", shots, 1)
        self._shots = shots
        if elevation_deg is not None:
            check_number("elevation_deg", elevation_deg, -90, 90)
        self._pattern = cells_by_row(rig, elevation_deg)

    def fixed(self, budget: int) -> Demand:
        """The same cells at every keyframe."""
        return Demand(layers=[[self._pattern[: budget // self._shots]]])


def entry_elevation_deg(rig: Rig, above_m: float = 0.0) -> float:
    """Where the middle of a car stands that enters the range of scoring, seen from the LiDAR of a
    rig: -1.25 degrees from the default one, 1.84 m above the road. Of several that is the first;
    another stands `above_m` higher.
    """
    # To a hundredth of a degree: results were published for -1.25 degrees, not for -1.2488.
    rise = (ENTRY_HEIGHT_M - (rig.sensor_height_m + above_m)) / ENTRY_DISTANCE_M
    return round(math.degrees(math.atan(rise)), 2)


def cells_by_row(rig: Rig, elevation_deg: float | None = None) -> Cells:
    """(N,) all cells, row after row, the row nearest to an elevation first: the given one, else
    `entry_elevation_deg`. Every first few cells of a row lie evenly over it. On a tilted grid every
    column gives its own nearest cell to the first such row, and so on. Of several LiDARs each gives
    a cell of its own in turn, so that all begin with their nearest rows.
    """
    parts = [_own_cells_by_row(rig, head, elevation_deg) for head in rig.grid.heads]
    turns = np.concatenate([np.arange(len(part)) for part in parts])
    cells: Cells = np.concatenate(parts)[np.argsort(turns, kind="stable")]
    return cells


def _own_cells_by_row(rig: Rig, head: Head, elevation_deg: float | None) -> Cells:
    """The cells of one LiDAR in that order."""
    grid = head.grid
    wanted = entry_elevation_deg(rig, head.place[2]) if elevation_deg is None else elevation_deg
    off = np.abs(np.rad2deg(grid.elevations_everywhere) - wanted)
    rows = np.broadcast_to(np.argsort(off, axis=0, kind="stable"), grid.shape)
    columns = np.argsort(np.arange(grid.columns) * GOLDEN % 1)
    cells: Cells = (rows[:, columns] * grid.columns + columns).ravel() + head.first
    return cells


def entry_cells(rig: Rig) -> Cells:
    """(lidars * columns,) the cell of every column at which things enter the range of scoring; of
    several LiDARs one after the other.
    """
    columns = rig.grid.columns
    nearest = [_own_cells_by_row(rig, head, None)[:columns] for head in rig.grid.heads]
    return np.concatenate([cells[np.argsort(cells % columns)] for cells in nearest])
