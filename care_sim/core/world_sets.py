"""Sets of cells of several worlds, the sets of one world after those of another."""

from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Integers, Mask
from care_sim.core.cell_sets import CellSets


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
        """Of every set its cells from place `first` up to, not including, `last`."""
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
