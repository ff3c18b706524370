"""The random floor once more, in NumPy and without a batch in the way."""

import numpy as np
from hypothesis import strategies as st

from care_sim.core.firing.floor import Floor

_LOWER = 2**32 - 1
_32_BITS = st.integers(0, _LOWER)
drawn_floors = st.builds(Floor, _32_BITS, _32_BITS, st.integers(0, 1000))
FLOOR = Floor(1, 2, 3)


def philox(counter, key):
    """Philox 4x32-10 by the letter: four words of a counter of four, each a uint64 or an array."""
    a, b, c, d = (np.asarray(word, np.uint64) for word in counter)
    first, second = key
    for _ in range(10):
        low, high = a * np.uint64(0xD2511F53), c * np.uint64(0xCD9E8D57)
        a, b, c, d = (
            high >> np.uint64(32) ^ b ^ np.uint64(first),
            high & np.uint64(_LOWER),
            low >> np.uint64(32) ^ d ^ np.uint64(second),
            low & np.uint64(_LOWER),
        )
        first, second = (first + 0x9E3779B9) & _LOWER, (second + 0xBB67AE85) & _LOWER
    return a, b, c, d


def drawn_cells(floor, size, batches):
    """The cells of so many first batches of a floor, in their order."""
    counter = np.arange(32 * batches), floor.keyframe, 0, 0
    words = np.array(philox(counter, (floor.first, floor.second)))
    # A batch has the first words of its 32 blocks, then their second ones, and so on.
    words = words.reshape(4, batches, 32).transpose(1, 0, 2).ravel()
    products = words * np.uint64(size)
    kept = products & np.uint64(_LOWER) >= np.uint64(2**32 % size)
    return (products[kept] >> np.uint64(32)).astype(np.int64)


def floor_order(floor, size):
    """All cells (size,) in the order in which a floor names them first."""
    batches = 1 + size // 8
    while True:
        cells = drawn_cells(floor, size, batches)
        first = np.full(size, len(cells))
        # If a cell has several places, the one written last stays.
        first[cells[::-1]] = np.arange(len(cells))[::-1]
        if first.max() < len(cells):
            return np.argsort(first)
        batches *= 2
