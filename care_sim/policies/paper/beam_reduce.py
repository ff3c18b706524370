"""Beam reduction: the elevation rows nearest the horizon, up to the budget."""

import numpy as np

from care_sim.core.grid import Cells
from care_sim.core.grid_stack import Grid
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import FixedPolicy


class BeamReduce(FixedPolicy):
    """Beam reduction of LiDAR Distillation (Wei et al., ECCV 2022), as a causal scan policy.

    The original drops scan lines from a cloud. The paper (Sec. 5.1) adapts it: whole rows are
    fired, the nearest to the horizon first. The last row is thinned evenly, so that exactly B cells
    are asked for.
    """

    name = "beam-reduce"
    source = "CARE paper, Sec. 5.1, after Wei et al., LiDAR Distillation, ECCV 2022"

    def __init__(self, rig: Rig):
        super().__init__(rig)
        self._rows = horizon_rows(rig.grid, rig.budget)

    def fixed(self, budget: int) -> Demand:
        """One layer per row; no exploitation."""
        return Demand(layers=[[cells] for cells in self._rows])


def horizon_rows(grid: Grid, count: int) -> list[Cells]:
    """The cells of the rows nearest the horizon, nearest first, `count` in all.

    The last row is evenly thinned.
    """
    # The height of a row's unit ray straight ahead orders rows as their elevation does. Rows as far
    # above the horizon as below keep the order of their index: the upper one first.
    rises = [
        head.grid.directions[int(np.argmin(head.grid.from_ahead)) :: grid.columns, 2]
        for head in grid.heads
    ]
    nearest = np.argsort(np.abs(np.concatenate(rises)), kind="stable")
    whole, rest = divmod(count, grid.columns)
    # Whole rows, then the rest in one more, if there is any.
    widths = [grid.columns] * whole + [rest] * (rest > 0)
    return [
        row * grid.columns + np.arange(width) * grid.columns // width
        for row, width in zip(nearest.tolist(), widths, strict=False)
    ]
