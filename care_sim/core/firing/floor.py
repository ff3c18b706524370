"""The shared random floor, line 6 of Algorithm 1: a random order of all cells at every keyframe.

The order is that of `numpy.random.Generator.permutation`, to the last cell. It is drawn here, in a
quarter of the time, because it takes an eighth of a keyframe there. NumPy's generator, PCG64, is
PCG XSL RR 128/64 of O'Neill, PCG: A Family of Simple Fast Space-Efficient Statistically Good
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
        # Unspent ones are drawn all the same, so that no action moves the later ones.
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
