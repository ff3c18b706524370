"""Downsampling of a full scan to the fraction of points that the budget stands for."""

from abc import abstractmethod

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.belief import Belief
from care_sim.core.grid import Cells
from care_sim.core.types import Demand
from care_sim.policies.base import PrivilegedPolicy


class MatchedFraction(PrivilegedPolicy):
    """A reference that is not causal (paper, Sec. 5.1).

    It sees the full cloud of P points before it chooses, keeps round(beta P) of them, and so saves
    no sensing. The rest of the budget goes to
    cells that return nothing, in ascending order, so that the shared floor adds no point.
    """

    tags = ("non-causal",)

    @abstractmethod
    def kept(self, cells: Cells, points: Floats, count: int) -> Cells:
        """`count` of `cells` (P,), which return `points` (P, 3) in the sensor frame."""

    def demand(self, belief: Belief) -> Demand:
        """The kept points, then silent cells."""
        scan = self.truth.full_scan()
        returned = np.isfinite(scan.ranges)
        cells = scan.cells[returned]
        points = self.rig.grid.points(cells, scan.ranges[returned])
        # beta is the budget over all cells: the belief tells the budget in cells.
        kept = self.kept(cells, points, round(belief.budget * len(cells) / self.rig.grid.size))
        silent = scan.cells[~returned][: belief.budget - len(kept)]
        return Demand(layers=[[np.sort(kept)], [silent]])
