"""The shared random floor, line 6 of Algorithm 1: an endless series of random cells per keyframe.

Each cell of the series is drawn uniformly from all cells. A reader skips cells that are chosen
already, so the cells in order of their first appearance are a uniformly random permutation. A
reader draws only as far as its budget needs.

The random words are those of Philox 4x32-10: Salmon, Moraes, Dror and Shaw, Parallel Random
Numbers: As Easy as 1, 2, 3, SC 2011. Its words are a function of a key and a counter, so the floor
of a keyframe depends on no keyframe before.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_sim.base.compiled import compiled
from care_sim.core.grid import Cells

_BLOCKS = 32
"""Blocks of four words that are drawn together. Compiled code computes several at once."""
_ROUNDS = 10
_FIRST_FACTOR = np.uint64(0xD2511F53)
_SECOND_FACTOR = np.uint64(0xCD9E8D57)
_FIRST_STEP = 0x9E3779B9
_SECOND_STEP = 0xBB67AE85
_32 = np.uint64(32)
_LOWER = 2**32 - 1


class Floor(NamedTuple):
    """The random floor of a keyframe, counted from 0. The words `first` and `second` are the key of
    the episode (`floor_key`).
    """

    first: int
    second: int
    keyframe: int


def floor_key(seed: np.random.SeedSequence, number: int) -> tuple[int, int]:
    """Return the key of an episode's floor of this number. Number 0 is the seed's own floor, the
    others belong to its children.
    """
    # `seed.spawn` would count the children, and make those before `number - 1`.
    children = (number - 1,) if number else ()
    own = np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, *children))
    first, second = own.generate_state(2).tolist()
    return first, second


@compiled()
def draw_cells(floor: Floor, batch: int, size: int) -> Cells:
    """Return the next cells (n,) of a floor over `size` cells, `batch` by `batch` from 0."""
    words = np.empty((4, _BLOCKS), np.uint32)
    _draw_words(floor, batch, words)
    # A word times `size` is a cell in the upper half. Words whose lower half is below 2^32 modulo
    # `size` are left out: the others give every cell equally often (Lemire, Fast Random Integer
    # Generation in an Interval, ACM TOMACS 2019).
    least = 2**32 % size
    cells = np.empty(words.size, np.int64)
    count = 0
    for word in words.flat:
        product = np.int64(word) * size
        cells[count] = product >> 32
        count += int(product & _LOWER >= least)
    return cells[:count]


@compiled()
def _draw_words(floor: Floor, batch: int, words: NDArray[np.uint32]) -> None:
    """Fill `words` (4, n) with n blocks, the first words of all blocks first."""
    for block in range(words.shape[1]):
        words[0, block] = batch * words.shape[1] + block
        words[1, block] = floor.keyframe
        words[2:, block] = 0
    first, second = floor.first, floor.second
    for _ in range(_ROUNDS):
        for block in range(words.shape[1]):
            one = np.uint64(words[0, block]) * _FIRST_FACTOR
            other = np.uint64(words[2, block]) * _SECOND_FACTOR
            words[0, block] = np.uint32(other >> _32) ^ words[1, block] ^ np.uint32(first)
            words[1, block] = np.uint32(other)
            words[2, block] = np.uint32(one >> _32) ^ words[3, block] ^ np.uint32(second)
            words[3, block] = np.uint32(one)
        first, second = first + _FIRST_STEP & _LOWER, second + _SECOND_STEP & _LOWER
