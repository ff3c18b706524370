"""Hardware: cells that fire together, and a choice of them for what is demanded.

Hardware may fire a cell more than once: it then stands as often among what fired.
"""

from abc import ABC, abstractmethod
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from care_sim.base.checks import check_number
from care_sim.base.compiled import compiled
from care_sim.core.allocation import budget_cells
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.cells.stack import Grid
from care_sim.core.defaults import CELLS
from care_sim.core.firing.floor import Floor, draw_cells
from care_sim.core.grid import Cells


class Hardware(ABC):
    """The cells of a `grid` in units that fire as a whole, `unit_cells` cells each.

    The budget is paid in units. Subclasses state the `name` as in `firing`, the `unit` in one word,
    the `product`, and its public `source`. `numbers` are the settings after the colon of `firing`,
    if any, with their `usual` values. `spends_floor` says whether the random floor gets what is
    left of the budget. `most_shots` is how often a cell may be fired at a keyframe, and `counted`,
    in one word, what the budget B is a number of.
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
    def fire(self, scores: NDArray[Any], budget: int, floor: Floor | None, last: Cells) -> Cells:
        """The cells that fire, ascending, never more than `budget`; where one may be fired more
        than once, it stands there once for every shot.

        Cells with strictly positive `scores` (E, A) are demanded, the highest score first, ties by
        ascending index. Then the `floor` spends what is left; None leaves the rest unspent. `last`
        are the cells that fired at the keyframe before, none at the first one.
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
    """Return the distinct cells (n,) of `fired`, ascending, and the number of shots per cell
    (size,) of a grid of that size. The number is None if no cell fires more than once, as with all
    but one hardware.
    """
    again = fired[1:] == fired[:-1]
    # Asked at every keyframe of every hardware: a count of all cells would take much longer.
    if not again.any():
        return fired, None
    shots = np.bincount(fired, minlength=size)
    return np.flatnonzero(shots), shots


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

    def fire(self, scores: NDArray[Any], budget: int, floor: Floor | None, last: Cells) -> Cells:
        """The demanded cells up to the budget, then the floor."""
        return fired_cells(scores, budget, floor)

    def best(self, worth: Floats, budget: int, last: Cells) -> Integers:
        """Any cells can fire together."""
        return ranked(worth)[:budget]


def fired_cells(scores: NDArray[np.floating] | Mask, budget: int, floor: Floor | None) -> Cells:
    """The cells that an action fires, ascending.

    They are the `budget` highest strictly positive `scores` (E, A), ties by ascending index. Where
    there are fewer, the `floor` tops them up; None leaves the rest unspent.
    """
    flat = scores.ravel().astype(np.float32, copy=False)
    chosen, cells = np.empty(len(flat), np.bool_), np.empty(len(flat) + 1, np.int64)
    units = np.arange(len(flat))
    has_floor = floor is not None
    count = fire_free(flat, budget, has_floor, floor or _NO_FLOOR, units, chosen, cells)
    return cells[:count].copy()


_NO_FLOOR = Floor(0, 0, 0)


@compiled()
def fire_free(
    scores: NDArray[np.float32],
    budget: int,
    has_floor: bool,
    floor: Floor,
    units: Integers,
    chosen: Mask,
    cells: Cells,
) -> int:
    """Fill `cells` as `fired_cells` by `scores` (N,), and return how many there are. `cells` has
    room for one more, `units` (N,) are the cells themselves, and `chosen` (N,) is overwritten.
    """
    count = _choose_demanded(scores, budget, chosen)
    if has_floor:
        count = top_up(floor, units, chosen, count, budget)
    _list_chosen(chosen, cells)
    return count


@compiled()
def _choose_demanded(scores: NDArray[np.float32], budget: int, chosen: Mask) -> int:
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
def take_units(order: Cells, unit_of: Integers, taken: Mask, count: int, most: int) -> int:
    """Mark the units of the cells `order` as taken, in its order, until `most` of them are;
    `count` are before. Returns how many are afterwards.
    """
    for cell in order:
        if count >= most:
            break
        unit = unit_of[cell]
        count += not taken[unit]
        taken[unit] = True
    return count


@compiled()
def top_up(floor: Floor, unit_of: Integers, taken: Mask, count: int, most: int) -> int:
    """As `take_units`, in the order of the `floor`."""
    batch = 0
    most = min(most, len(taken))
    while count < most:
        cells = draw_cells(floor, batch, len(unit_of))
        count = take_units(cells, unit_of, taken, count, most)
        batch += 1
    return count


@compiled()
def _list_chosen(chosen: Mask, cells: Cells) -> None:
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


MOST_SHOTS = 100
"""Ten times the reach, as far as reach grows with the root of the shots."""


class Energy(FreeCells):
    """Free cells, each of which may be fired up to `shots` times at a keyframe; what its receiver
    counts adds up (`care_sim.sensors.signal`, `care_sim.sensors.lidar`).

    The scores say how the energy is to be shared. Shots are dealt one by one, each to the cell
    whose score is the highest per shot that it would then have (as seats are dealt to parties by
    D'Hondt). So equal scores have equally many shots, all cells their first one before any its
    second, and scores of 3 to 1 get three shots to one. The floor spends what is left once every
    demanded cell has `shots`. With one shot that is free cells.

    No product is known that aims every shot and counts photons over several.
    """

    name = "energy"
    numbers = ("SHOTS",)
    usual = (4,)
    unit = counted = "shot"
    product = "agile scanner whose receiver counts photons over several shots of a direction"
    source = (
        "AEye, RRRWP_19_0812, for shots that revisit a direction; Ouster, US 2023/0243975 A1, "
        "abstract, for counts added up over laser cycles"
    )

    def __init__(self, grid: Grid, shots: int):
        check_number("shots of firing energy", shots, 1, MOST_SHOTS)
        super().__init__(grid)
        self.most_shots = shots

    def fire(self, scores: NDArray[Any], budget: int, floor: Floor | None, last: Cells) -> Cells:
        """A cell for every shot, ascending: one that is fired n times stands there n times."""
        # A score is what an action holds, float32; a share of it needs more bits.
        flat = scores.ravel().astype(np.float32).astype(np.float64)
        cells = demanded(scores)
        # The nth shot of a cell comes after n shots of every cell before it, so that no more cells
        # than the budget holds n times can have an nth shot.
        numbers = range(1, self.most_shots + 1)
        rounds = [cells[: budget // number] for number in numbers]
        claims = [flat[cells] / number for number, cells in zip(numbers, rounds, strict=True)]
        # Equal claims are ranked by the number of the shot, then by the cell, lower first.
        dealt = np.argsort(-np.concatenate(claims), kind="stable")[:budget]
        fired = np.concatenate(rounds)[dealt]
        if floor is not None:
            asked = flat > 0
            chosen = asked.copy()
            top_up(floor, self.unit_of, chosen, len(fired), budget)
            fired = np.concatenate([fired, np.flatnonzero(chosen & ~asked)])
        return np.sort(fired)
