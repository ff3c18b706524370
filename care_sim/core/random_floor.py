"""The shared random floor: at every keyframe a permutation of all cells, the same for every policy."""

import numpy as np

from care_sim.core.grid import Cells


class Floor:
    """Number 0 is the seed's own floor, the others are drawn from its children."""

    def __init__(self, seed: np.random.SeedSequence, number: int, cells: int):
        children = (number - 1,) if number else ()
        own = np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, *children))
        self._rng, self._cells = np.random.default_rng(own), cells

    def next(self) -> Cells:
        """The floor of the coming keyframe; to be drawn at every one, spent or not."""
        return self._rng.permutation(self._cells)
