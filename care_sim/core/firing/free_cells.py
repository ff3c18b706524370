"""Free cells: every cell fires by itself. The paper's hardware, and the default."""

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.defaults import CELLS
from care_sim.core.firing.base import Floor, Hardware, ranked
from care_sim.core.grid import Cells
from care_sim.core.grid_stack import Grid

_DIGIT = 11
"""Bits that are counted at a time; three times as many hold every score."""


class FreeCells(Hardware):
    """A sensor that aims every shot, in any order. The paper assumes it (Sec. 3)."""

    name = CELLS
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
        return fired_cells(scores, budget, floor)

    def best(self, worth: Floats, budget: int, last: Cells) -> Integers:
        """Any cells can fire together."""
        return ranked(worth)[:budget]


def fired_cells(scores: NDArray[np.floating] | Mask, budget: int, floor: Floor) -> Cells:
    """The cells that an action fires, ascending.

    They are the `budget` highest strictly positive `scores` (E, A), ties by ascending index. Where
    there are fewer, the `floor` tops them up; None leaves the rest unspent.
    """
    flat = scores.ravel().astype(np.float32, copy=False)
    chosen = np.empty(len(flat), np.bool_)
    count = choose_demanded(flat, budget, chosen)
    # An action that spends the budget itself needs no floor, and a floor takes longer to draw than
    # a scan of its cells.
    if floor is not None and count < budget:
        count = top_up(chosen, count, floor(), budget)
    cells = np.empty(count + 1, np.int64)
    list_chosen(chosen, cells)
    return cells[:count]


@compiled()
def choose_demanded(scores: NDArray[np.float32], budget: int, chosen: Mask) -> int:
    """Set in `chosen` (N,) whether a cell is one of the `budget` with the highest strictly positive
    `scores` (N,), of equals the lower one. Returns how many are.
    """
    # Counted as narrow as the scores are: as many of both are computed at once.
    count = np.int32(0)
    for cell in range(len(scores)):
        is_positive = scores[cell] > np.float32(0)
        chosen[cell] = is_positive
        count = np.int32(count + is_positive)
    if count <= budget:
        return int(count)

    # Bits of positive floats ascend as their values do.
    ranks = scores.view(np.int32)
    least, equals = _nth_highest(ranks, budget)
    for cell in range(len(ranks)):
        is_last = ranks[cell] == least and equals > 0
        equals -= is_last
        chosen[cell] = ranks[cell] > least or is_last
    return budget


@compiled()
def top_up(chosen: Mask, count: int, floor: NDArray[np.integer], budget: int) -> int:
    """Choose the first of the `floor` besides, up to the budget; `count` are chosen before. Returns
    how many are afterwards.
    """
    for cell in floor:
        if count >= budget:
            break
        count += not chosen[cell]
        chosen[cell] = True
    return count


@compiled()
def list_chosen(chosen: Mask, cells: Cells) -> None:
    """Fill `cells` with those that are `chosen`, ascending; it is longer than their number."""
    # Every cell is written, and the next one over it if it is not chosen: no branch could foretell
    # the cells of a random floor.
    count = 0
    for cell in range(len(chosen)):
        cells[count] = cell
        count += chosen[cell]


@compiled()
def _nth_highest(numbers: NDArray[np.int32], n: int) -> tuple[int, int]:
    """The nth highest of `numbers`, of which n or more are above 0; and how many of those that
    equal it are among the n highest.
    """
    # All are written, and the next one over what is not kept: that needs no branch.
    kept = np.empty(len(numbers) + 1, np.int32)
    count = 0
    for number in numbers:
        kept[count] = number
        count += number > 0

    # Its bits are found a few at a time, the highest first, by counting how many numbers have which
    # of them; only those with the same bits so far are counted.
    known = 0
    for shift in (_DIGIT * 2, _DIGIT, 0):
        holding = np.zeros(1 << _DIGIT, np.int64)
        for number in kept[:count]:
            holding[number >> shift & (1 << _DIGIT) - 1] += 1
        digit = len(holding) - 1
        while holding[digit] < n:
            n -= holding[digit]
            digit -= 1
        known = known << _DIGIT | digit
        same = 0
        for number in kept[:count]:
            kept[same] = number
            same += number >> shift == known
        count = same
    return known, n
