"""Free cells: every cell fires by itself. The paper's hardware, and the default."""

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.firing.base import Floor, Hardware, demanded, ranked
from care_sim.core.grid import Cells
from care_sim.core.grid_stack import Grid

_NO_FLOOR = np.empty(0, np.int64)


class FreeCells(Hardware):
    """A sensor that aims every shot, in any order. The paper assumes it (Sec. 3)."""

    name = "cells"
    unit = "cell"
    product = "agile scanner that aims single shots"
    source = (
        "AEye, white paper Rethinking the Three Rs of LiDAR: Rate, Resolution and Range, "
        "RRRWP_19_0812, 2019"
    )

    def __init__(self, grid: Grid):
        super().__init__(grid, unit_cells=1)

    @cached_property
    def unit_of(self) -> Integers:
        """(N,) the cells themselves."""
        return np.arange(self.grid.size)

    def fire(self, scores: NDArray[Any], budget: int, floor: Floor, last: Cells) -> Cells:
        """The demanded cells up to the budget, then the floor."""
        # An action that spends the budget itself needs no floor, and a floor takes longer to draw
        # than a scan of its cells.
        needed = floor is not None and np.count_nonzero(scores > 0) < budget
        return fired_cells(scores, budget, floor() if floor is not None and needed else None)

    def best(self, worth: Floats, budget: int, last: Cells) -> Integers:
        """Any cells can fire together."""
        return ranked(worth)[:budget]


def fired_cells(scores: NDArray[np.floating] | Mask, budget: int, floor: Cells | None) -> Cells:
    """The cells that an action fires, ascending.

    They are the `budget` highest strictly positive `scores` (E, A), ties by ascending index. Where
    there are fewer, `floor` tops them up; None leaves the rest unspent.
    """
    wanted = scores.ravel().astype(np.float32, copy=False) > 0
    count = int(np.count_nonzero(wanted))
    if count > budget:
        return np.sort(demanded(scores)[:budget])
    return _topped_up(wanted, count, _NO_FLOOR if floor is None else floor, budget)


@compiled()
def _topped_up(wanted: Mask, count: int, floor: Cells, budget: int) -> Cells:
    """The `count` cells that are `wanted` (N,) and the first of the `floor` besides, up to the
    budget, ascending. `wanted` is overwritten.
    """
    for cell in floor:
        if count >= budget:
            break
        count += not wanted[cell]
        wanted[cell] = True
    fired = np.empty(count, np.int64)
    place = 0
    for cell in range(len(wanted)):
        if wanted[cell]:
            fired[place] = cell
            place += 1
    return fired
