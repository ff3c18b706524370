"""Hardware: cells that fire together, and a choice of them for what is demanded.

Hardware may fire a cell more than once: it then stands as often among what fired.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cached_property
from typing import Any, ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray

from care_sim.core.allocation import budget_cells
from care_sim.core.arrays import Floats, Integers
from care_sim.core.grid import Cells
from care_sim.core.grid_stack import Grid

Floor: TypeAlias = Callable[[], NDArray[np.integer]] | None
"""Draws the random floor of a keyframe, a permutation of all cells; None of an environment without
one."""


class Hardware(ABC):
    """The cells of a `grid` in units that fire as a whole, `unit_cells` cells each.

    The budget is paid in units. Subclasses name what they stand for: `name` as `firing` has it, the
    `numbers` behind the colon of it, if any, with their `usual` values, the `unit` in one word, the
    `product`, and its public `source`. `spends_floor` says whether the random floor gets what is
    left of the budget. `most_shots` is how often a cell may be fired at a keyframe, and
    `counted`, in one word, what the budget B is a number of.
    """

    name: ClassVar[str]
    numbers: ClassVar[tuple[str, ...]] = ()
    usual: ClassVar[tuple[float, ...]] = ()
    unit: ClassVar[str]
    product: ClassVar[str]
    source: ClassVar[str]
    spends_floor: ClassVar[bool] = True
    counted: ClassVar[str] = "cell"
    most_shots: int = 1

    def __init__(self, grid: Grid, unit_cells: int):
        self.grid = grid
        self.unit_cells = unit_cells

    @property
    def units(self) -> int:
        """How many units the grid has."""
        return self.grid.size // self.unit_cells

    @cached_property
    @abstractmethod
    def unit_of(self) -> Integers:
        """(N,) the number of the unit of every cell."""

    def budget_cells(self, budget: float) -> int:
        """B in cells, of whole units: round(beta * units) of them (Eq. 1 in the hardware's unit).

        Raises InvalidInput for a fraction outside (0, 1], and for one that leaves no unit.
        """
        return self.unit_cells * budget_cells(budget, self.units, self.unit)

    @abstractmethod
    def fire(self, scores: NDArray[Any], budget: int, floor: Floor, last: Cells) -> Cells:
        """The cells that fire, ascending, never more than `budget`; where one may be fired more
        than once, it stands there once for every shot.

        Cells with strictly positive `scores` (E, A) are demanded, the highest score first, ties by
        ascending index. Then the `floor` spends what is left. `last` are the cells that fired at
        the keyframe before, none at the first one.
        """

    @abstractmethod
    def best(self, worth: Floats, budget: int, last: Cells) -> Integers:
        """The units that can fire together within `budget` cells and are worth the most in all, the
        best first, of equals the lower one; none that is worth nothing. `worth` (units,) is that of
        each, 0 or more; `last` as in `fire`.
        """

    def credited(self, demanded: Cells, fired: Cells) -> Integers:
        """(n,) for every fired cell (n,) the place in `demanded` (k,) of the first cell that its
        unit was demanded for; k where nothing of the unit was demanded.
        """
        first = np.full(self.units, len(demanded))
        np.minimum.at(first, self.unit_of[demanded], np.arange(len(demanded)))
        return first[self.unit_of[fired]]


def ranked(values: NDArray[Any]) -> Integers:
    """(k,) the places of strictly positive values, the highest first, ties by ascending place."""
    flat = values.ravel()
    chosen = np.flatnonzero(flat > 0)
    # Negated, a stable ascending sort puts the highest first and leaves ties in their order.
    return chosen[np.argsort(-flat[chosen].astype(np.float64), kind="stable")]


def demanded(scores: NDArray[Any]) -> Cells:
    """(k,) the cells with strictly positive `scores` (E, A), those of an action in float32, the
    highest first, ties by ascending cell: as `ranked` has them.
    """
    flat = scores.ravel().astype(np.float32, copy=False)
    (cells,) = (flat > 0).nonzero()
    # Bits of positive floats ascend as their values do. A score and its cell are one whole number,
    # and whole numbers are sorted in an eighth of the time of a stable argsort.
    falling = (~flat[cells].view(np.uint32)).astype(np.uint64)
    keys = np.sort(falling << np.uint64(32) | cells.astype(np.uint64))
    return (keys & np.uint64(0xFFFFFFFF)).astype(np.int64)


def shots_by_cell(fired: Cells, size: int) -> tuple[Cells, Integers | None]:
    """The cells (n,) of what `fired`, ascending, each once, and (size,) how often each cell of a
    grid of that size fires; None where none fires more than once, as with all but one hardware.
    """
    again = fired[1:] == fired[:-1]
    # Asked at every keyframe of every hardware: a count of all cells would take much longer.
    if not again.any():
        return fired, None
    shots = np.bincount(fired, minlength=size)
    return np.flatnonzero(shots), shots
