"""Sets of cells, one after the other in one array: the form that compiled code takes and gives."""

from collections.abc import Iterator, Sequence
from functools import cached_property
from itertools import accumulate, pairwise
from typing import Any, NamedTuple, overload

import numpy as np
from numpy.typing import NDArray

from care_sim.base.checks import as_array
from care_sim.base.compiled import compiled
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Integers, Mask

_NONE = np.empty(0, np.int64)


class CellSets(Sequence[Integers]):
    """Sets of cells, each in its own order: `cells` (n,) of one after the other, and the `sizes`
    (m,) of the sets.

    It reads as a sequence of arrays. Compiled code takes it as two arrays, where a list of arrays
    would be converted one by one at every call.
    """

    def __init__(self, cells: Integers, sizes: Integers):
        self.cells = cells
        self.sizes = sizes

    @classmethod
    def of(cls, sets: Sequence[Integers]) -> "CellSets":
        """The same sets in this form. Raises InvalidInput for one that is no list of indices."""
        if isinstance(sets, CellSets):
            return sets
        arrays = [cell_indices(cells) for cells in sets]
        # A set without cells may be of any type.
        cells = np.concatenate([_NONE, *arrays], dtype=np.int64, casting="unsafe")
        return cls(cells, np.array([*map(len, arrays)], np.int64))

    @classmethod
    def joined(cls, groups: Sequence["CellSets"]) -> "CellSets":
        """All sets of some groups, group after group."""
        return cls(
            np.concatenate([_NONE, *(group.cells for group in groups)]),
            np.concatenate([_NONE, *(group.sizes for group in groups)]),
        )

    def __len__(self) -> int:
        return len(self.sizes)

    @overload
    def __getitem__(self, place: int) -> Integers: ...
    @overload
    def __getitem__(self, place: slice) -> list[Integers]: ...
    def __getitem__(self, place: Any) -> Any:
        return self._arrays[place]

    def __iter__(self) -> Iterator[Integers]:
        return iter(self._arrays)

    def take(self, rows: Integers | Mask) -> "CellSets":
        """Some of the sets, by index or mask."""
        starts = np.cumsum(self.sizes) - self.sizes
        sizes = self.sizes[rows]
        return CellSets(_gathered(self.cells, starts[rows], sizes), sizes)

    def part(self, first: int, last: int) -> "CellSets":
        """Return the cells of every set from place `first` up to, not including, `last`."""
        return CellSets(*_parts(self.cells, self.sizes, first, last))

    @cached_property
    def _arrays(self) -> list[Integers]:
        bounds = accumulate(self.sizes.tolist(), initial=0)
        return [self.cells[start:end] for start, end in pairwise(bounds)]


def cell_indices(
    cells: Sequence[int] | Integers, name: str = "a set of cells"
) -> NDArray[np.integer]:
    """`cells` as an array. Raises InvalidInput for what is no list of indices."""
    array = as_array(name, cells)
    if array.ndim != 1 or not (array.dtype.kind in "iu" or array.size == 0):
        raise InvalidInput(
            f"{name} must be a list of cell indices, got {array.dtype} of shape {array.shape}"
            " (of a mask take np.flatnonzero)"
        )
    return array


@compiled()
def _gathered(cells: Integers, starts: Integers, sizes: Integers) -> Integers:
    """The pieces of `cells` of so many `sizes` (n,) that begin at `starts` (n,)."""
    pieces = np.empty(sizes.sum(), np.int64)
    place = 0
    for n in range(len(sizes)):
        end = place + sizes[n]
        pieces[place:end] = cells[starts[n] : starts[n] + sizes[n]]
        place = end
    return pieces


@compiled()
def _parts(cells: Integers, sizes: Integers, first: int, last: int) -> tuple[Integers, Integers]:
    """See `CellSets.part`."""
    starts = np.cumsum(sizes) - sizes + np.minimum(first, sizes)
    part_sizes = np.minimum(last, sizes) - np.minimum(first, sizes)
    return _gathered(cells, starts, part_sizes), part_sizes


class WorldSets(NamedTuple):
    """All the `sets`, and how many of them are of each world: `counts` (W,)."""

    sets: CellSets
    counts: Integers

    @classmethod
    def nothing(cls, worlds: int) -> "WorldSets":
        """No sets of so many worlds."""
        return cls(CellSets.of([]), np.zeros(worlds, np.int64))

    def take(self, kept: Mask) -> "WorldSets":
        """Some of the sets, by mask."""
        return WorldSets(self.sets.take(kept), kept_of_each(kept, self.counts))

    def part(self, first: int, last: int) -> "WorldSets":
        """Return the cells of every set from place `first` up to, not including, `last`."""
        return WorldSets(self.sets.part(first, last), self.counts)


@compiled()
def kept_of_each(kept: Mask, counts: Integers) -> Integers:
    """(W,) how many rows of each world are `kept` (n,), of which the first `counts[0]` are of world
    0, the next `counts[1]` of world 1, and so on.
    """
    found = np.zeros(len(counts), np.int64)
    row = 0
    for world, count in enumerate(counts):
        for _ in range(count):
            found[world] += kept[row]
            row += 1
    return found
