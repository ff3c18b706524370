"""PCG64, the generator behind `numpy.random.default_rng`, compiled: the numbers of NumPy, for one
world or for many.

It is PCG XSL RR 128/64 of O'Neill, PCG: A Family of Simple Fast Space-Efficient Statistically Good
Algorithms for Random Number Generation, HMC-CS-2014-0905. Its state is a number of 128 bits, here
two halves, which every step multiplies by a constant and adds an increment to.
"""

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Integers

Wide: TypeAlias = tuple[np.uint64, np.uint64]
"""A number of 128 bits: its upper and its lower half."""

_MULTIPLIER = 0x2360ED051FC65DA44385DF649FCCF645
_LANES = 16
"""States that go on side by side. Compiled code computes several at once, and none of them waits
for the product before."""
_32 = np.uint64(32)
_58 = np.uint64(58)
_63 = np.uint64(63)
_64 = np.uint64(64)
_LOWER = np.uint64(2**32 - 1)
_HALF = 2**64 - 1


class WordStreams(NamedTuple):
    """A stream of random words for each of W worlds: `lanes` (W, 2, n), the upper and the lower
    halves of n neighbouring states; `increments` (W, 2), the halves of what is added when all of
    them leap over each other; the `numbers` (W, n) of 64 bits that were drawn last; their halves
    `words` (W, 2 n) in the same memory, the lower one first; how many words are `used` (W,).
    """

    lanes: NDArray[np.uint64]
    increments: NDArray[np.uint64]
    numbers: NDArray[np.uint64]
    words: NDArray[np.uint32]
    used: Integers

    def __reduce__(self) -> tuple[object, ...]:
        # Copied one by one, numbers and words would no longer share their memory.
        return _streams_of, (self.lanes, self.increments, self.numbers, self.used)


def word_streams(worlds: int) -> WordStreams:
    """Streams that are yet to be seeded."""
    numbers = np.zeros((worlds, _LANES), np.uint64)
    lanes = np.zeros((worlds, 2, _LANES), np.uint64)
    increments = np.zeros((worlds, 2), np.uint64)
    return _streams_of(lanes, increments, numbers, np.zeros(worlds, np.int64))


def _streams_of(
    lanes: NDArray[np.uint64],
    increments: NDArray[np.uint64],
    numbers: NDArray[np.uint64],
    used: Integers,
) -> WordStreams:
    # Numba compiles for machines alone that keep the lower half first.
    return WordStreams(lanes, increments, numbers, numbers.view(np.uint32), used)


def seed_stream(streams: WordStreams, world: int, seed: np.random.SeedSequence) -> None:
    """Begin the stream of a world as `numpy.random.PCG64(seed)` begins."""
    begun = np.random.PCG64(seed).state["state"]
    state, increment = begun["state"], begun["inc"]
    for lane in range(_LANES):
        # NumPy goes a step on before it takes a number; here the states are those of the numbers
        # to come.
        state = state * _MULTIPLIER + increment
        streams.lanes[world, :, lane] = _halves(state)
    streams.increments[world] = _halves(increment * _INCREMENTS)
    streams.used[world] = streams.words.shape[1]


def _halves(number: int) -> tuple[int, int]:
    return number >> 64 & _HALF, number & _HALF


def _limbs(number: int) -> tuple[np.uint64, ...]:
    """The upper half, the lower one, and the two halves of the latter: as products need them."""
    upper, lower = _halves(number)
    return tuple(map(np.uint64, (upper, lower, lower >> 32, lower & 2**32 - 1)))


def _leap(steps: int) -> tuple[int, int]:
    """What so many steps multiply the state by, and how often they add the increment."""
    factor, increments = 1, 0
    for _ in range(steps):
        factor, increments = factor * _MULTIPLIER, increments * _MULTIPLIER + 1
    return factor, increments


_FACTOR, _INCREMENTS = _leap(_LANES)
_LEAP = _limbs(_FACTOR)


@compiled()
def refill(streams: WordStreams, world: int) -> None:
    """Draw the next words of a world, as many as the table holds."""
    upper, lower = streams.lanes[world, 0], streams.lanes[world, 1]
    numbers = streams.numbers[world]
    increment = streams.increments[world, 0], streams.increments[world, 1]
    # As many as there are lanes, which the compiler is not told: it would write out a loop of known
    # length step by step, and then compute none of them together.
    for lane in range(len(numbers)):
        now = upper[lane], lower[lane]
        # What a state gives is its halves in one, turned by as many bits as its first six say.
        mixed, turn = now[0] ^ now[1], now[0] >> _58
        numbers[lane] = mixed >> turn | mixed << (_64 - turn & _63)
        upper[lane], lower[lane] = _product_and(now, _LEAP, increment)
    streams.used[world] = 0


@compiled()
def _product_and(number: Wide, factor: tuple[np.uint64, ...], addend: Wide) -> Wide:
    """The lowest 128 bits of a number, times a factor (`_limbs`), plus an addend."""
    # Long multiplication of the lower halves, in digits of 32 bits: no product overflows, nor does
    # one with two more digits added to it.
    high, low = number[1] >> _32, number[1] & _LOWER
    least = low * factor[3] + (addend[1] & _LOWER)
    middle = high * factor[3] + (least >> _32)
    carried = low * factor[2] + (middle & _LOWER) + (addend[1] >> _32)
    upper = high * factor[2] + (middle >> _32) + (carried >> _32)

    # Of what the upper halves add, only the lower half counts.
    upper += number[1] * factor[0] + number[0] * factor[1] + addend[0]
    return upper, carried << _32 | least & _LOWER
