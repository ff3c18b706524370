"""The shared random floor, line 6 of Algorithm 1: a random order of all cells at every keyframe.

The order is that of `numpy.random.Generator.permutation`, to the last cell. It is drawn here, in a
quarter of the time, because it takes an eighth of a keyframe there.
"""

import numpy as np
from numpy.typing import NDArray

from care_sim.base.compiled import compiled
from care_sim.core.pcg64 import WordStreams, refill, seed_stream, word_streams

FloorCells = NDArray[np.uint16] | NDArray[np.uint32]
"""(N,) all cells in a random order. The narrower they are, the quicker they are shuffled: those of
most grids fit into the cache that is next to the core."""
_1 = np.uint64(1)


class RandomFloor:
    """The shared random floor: at every keyframe a permutation of all cells, the same for every
    policy that plays the episode. Number 0 is the seed's own floor, the others are drawn from its
    children.
    """

    def __init__(self, seed: np.random.SeedSequence, number: int, cells: int):
        self._streams = word_streams(1)
        seed_stream(self._streams, 0, floor_seed(seed, number))
        self._floor = floor_cells(cells)
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


def floor_cells(cells: int) -> FloorCells:
    """Room for a floor of a grid with so many cells."""
    return np.empty(cells, np.uint16) if cells <= 2**16 else np.empty(cells, np.uint32)


@compiled()
def draw_floor(streams: WordStreams, world: int, cells: FloorCells) -> None:
    """Fill `cells` (N,) with the next floor of a world (Fisher and Yates; Knuth, The Art of
    Computer Programming 2, algorithm 3.4.2 P).
    """
    for cell in range(len(cells)):
        cells[cell] = cell
    # Drawn before any is swapped: what a draw waits for is the one before it alone.
    partners = np.empty_like(cells)
    _draw_partners(streams, world, partners)
    for place in range(len(cells) - 1, 0, -1):
        partner = partners[place]
        cells[place], cells[partner] = cells[partner], cells[place]


@compiled()
def _draw_partners(streams: WordStreams, world: int, partners: FloorCells) -> None:
    """Fill `partners` (N,) with a place from 0 to i for every place i, from the last down to 1."""
    words = streams.words[world]
    # Unsigned, so that what a comparison carries is subtracted as it is.
    used, count = np.uint64(streams.used[world]), np.uint64(len(words))
    place, mask = np.uint64(len(partners) - 1), np.uint64(0)
    while mask < place:
        mask = mask << _1 | _1
    while mask:
        # What is left over begins the next floor.
        if used == count:
            refill(streams, world)
            used -= count
        partner = np.uint64(words[used]) & mask
        used += _1

        # The fewest bits that hold `place` are drawn, and drawn again if they are beyond it: half
        # of them may be, and no branch could foretell which. So every one is kept, and the next
        # one written over it if it is beyond.
        partners[place] = partner
        place -= np.uint64(partner <= place)

        # Seldom, so that a branch is right: the one within keeps the compiler from making it a part
        # of what every draw waits for.
        if place <= mask >> _1:
            mask >>= _1
            if not mask:
                break
    streams.used[world] = used
