"""The shared random floor, line 6 of Algorithm 1: a random order of all cells at every keyframe.

The order is that of `numpy.random.Generator.permutation`, to the last cell. It is drawn here, in
less than half of the time, because it takes an eighth of a keyframe there.
"""

import numpy as np
from numpy.typing import NDArray

from care_sim.base.compiled import compiled
from care_sim.core.grid import Cells

_DRAWN = 4096
"""Numbers of 64 bits that are taken from the generator at a time; a floor takes about 11,000."""


class RandomFloor:
    """The shared random floor: at every keyframe a permutation of all cells, the same for every
    policy that plays the episode. Number 0 is the seed's own floor, the others are drawn from its
    children.
    """

    def __init__(self, seed: np.random.SeedSequence, number: int, cells: int):
        # What `seed.spawn` would give its child `number - 1`, without spawning those before it and
        # without moving the seed's own count of children.
        children = (number - 1,) if number else ()
        own = np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, *children))
        self._bits = np.random.PCG64(own)
        self._words = np.empty(0, np.uint32)
        self._ordered = np.arange(cells)
        self._floor = np.empty(0, np.int64)
        self._keyframe = -1

    def at(self, keyframe: int) -> Cells:
        """The floor of a keyframe, counted from 0, that is not before the last one asked for."""
        # Those that nobody spent are drawn all the same, so that no action moves the later ones.
        for _ in range(self._keyframe, keyframe):
            self._floor = self._permutation()
        self._keyframe = keyframe
        return self._floor

    def _permutation(self) -> Cells:
        cells = self._ordered.copy()
        last = len(cells) - 1
        while last > 0:
            # NumPy takes the lower half of a number first, then the upper one. What is left over
            # begins the next floor.
            if not len(self._words):
                self._words = self._bits.random_raw(_DRAWN).astype("<u8", copy=False).view("<u4")
            last, used = _shuffle(cells, last, self._words)
            self._words = self._words[used:]
        return cells


@compiled()
def _shuffle(cells: Cells, last: int, words: NDArray[np.uint32]) -> tuple[int, int]:
    """Shuffle `cells` from the place `last` down to 1, or until the random `words` are used up
    (Fisher and Yates; Knuth, The Art of Computer Programming 2, algorithm 3.4.2 P).

    Returns the place to go on with, and how many words were used.
    """
    used = 0
    while last > 0 and used < len(words):
        # A place from 0 to `last` is drawn as the fewest bits that hold `last`. Places down to half
        # of the mask, rounded up, have the same one.
        mask = 1
        while mask < last:
            mask = 2 * mask + 1
        while last > mask // 2 and used < len(words):
            # A draw beyond `last` is drawn again. Half of them may be: no branch could foretell
            # which, so the last cell changes places with itself instead.
            drawn = words[used] & mask
            used += 1
            fits = drawn <= last
            place = drawn if fits else last
            held = cells[last]
            cells[last] = cells[place]
            cells[place] = held
            last -= fits
    return last, used
