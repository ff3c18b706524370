"""The shared random floor, line 6 of Algorithm 1: a random order of all cells at every keyframe.

The order is that of `numpy.random.Generator.permutation`, to the last cell. It is drawn here, in
less than a third of the time, because it takes an eighth of a keyframe there.
"""

import numpy as np
from numpy.typing import NDArray

from care_sim.base.compiled import compiled
from care_sim.core.pcg64 import WordStreams, refill, seed_stream, word_streams

FloorCells = NDArray[np.int32]
"""(N,) all cells in a random order: half as wide as `Cells`, and shuffled in a sixth less time."""
_LOOKED_AT = 128
"""Words that are looked at together."""


class RandomFloor:
    """The shared random floor: at every keyframe a permutation of all cells, the same for every
    policy that plays the episode. Number 0 is the seed's own floor, the others are drawn from its
    children.
    """

    def __init__(self, seed: np.random.SeedSequence, number: int, cells: int):
        self._streams = word_streams(1)
        seed_stream(self._streams, 0, floor_seed(seed, number))
        self._floor: FloorCells = np.empty(cells, np.int32)
        self._keyframe = -1

    def at(self, keyframe: int) -> FloorCells:
        """The floor of a keyframe, counted from 0, that is not before the last one asked for."""
        # Those that nobody spent are drawn all the same, so that no action moves the later ones.
        if self._keyframe < keyframe:
            self._floor = np.empty_like(self._floor)
        for _ in range(self._keyframe, keyframe):
            draw_floor(self._streams, 0, self._floor)
        self._keyframe = keyframe
        return self._floor


def floor_seed(seed: np.random.SeedSequence, number: int) -> np.random.SeedSequence:
    """The seed of the floor of this number."""
    # What `seed.spawn` would give its child `number - 1`, without spawning those before it and
    # without moving the seed's own count of children.
    children = (number - 1,) if number else ()
    return np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, *children))


@compiled()
def draw_floor(streams: WordStreams, world: int, cells: FloorCells) -> None:
    """Fill `cells` (N,) with the next floor of a world."""
    for cell in range(len(cells)):
        cells[cell] = cell
    last = len(cells) - 1
    while last > 0:
        # What is left over begins the next floor.
        if streams.used[world] == streams.words.shape[1]:
            refill(streams, world)
        words = streams.words[world, streams.used[world] :]
        last, used = _shuffle(cells, last, words)
        streams.used[world] += used


@compiled()
def _shuffle(cells: FloorCells, last: int, words: NDArray[np.uint32]) -> tuple[int, int]:
    """Shuffle `cells` from the place `last` down to 1, or until the random `words` are used up
    (Fisher and Yates; Knuth, The Art of Computer Programming 2, algorithm 3.4.2 P).

    Returns the place to go on with, and how many words were used.
    """
    used = 0
    kept = np.empty(_LOOKED_AT, np.uint32)
    while last > 0 and used < len(words):
        # A place from 0 to `last` is drawn as the fewest bits that hold `last`. Places down to half
        # of the mask, rounded up, have the same one.
        mask = 1
        while mask < last:
            mask = 2 * mask + 1
        while last > mask // 2 and used < len(words):
            # A draw beyond `last` is drawn again. Half of them may be, and no branch could foretell
            # which: of so many words as surely have this mask, those within it are put together
            # without one. As `last` falls on the way a few more are beyond it, seldom enough for a
            # branch.
            looked_at = min(_LOOKED_AT, last - mask // 2, len(words) - used)
            most, count = np.uint32(last), 0
            for word in words[used : used + looked_at]:
                kept[count] = word & np.uint32(mask)
                count += kept[count] <= most
            used += looked_at
            for place in kept[:count]:
                if place <= last:
                    cells[last], cells[place] = cells[place], cells[last]
                    last -= 1
    return last, used
