"""Random numbers of many worlds, from a stream each, drawn for many keyframes at once."""

from collections.abc import Callable

import numpy as np

from care_sim.core.arrays import Floats, Mask

_KEYFRAMES = 64
"""For how many keyframes numbers are drawn at once."""


class DrawnAhead:
    """A row of numbers per world and keyframe, as long as the most that a world needs.

    `draw` gives the rows (k, n) of the next k keyframes of a world; for a generator of NumPy they
    are those of k calls for one.
    """

    def __init__(self, worlds: int, draw: Callable[[np.random.Generator, int, int], np.ndarray]):
        self._draw = draw
        self._streams: list[tuple[np.random.Generator, int] | None] = [None] * worlds
        self._numbers = np.zeros((worlds, _KEYFRAMES, 0))
        self._used = np.zeros(worlds, np.int64)

    def begin(self, world: int, seed: np.random.SeedSequence, numbers: int) -> None:
        """Begin an episode that needs so many numbers a keyframe."""
        self._streams[world] = np.random.default_rng(seed), numbers
        self._used[world] = 0

    def next(self, live: Mask, width: int) -> Floats:
        """(W, width) the numbers of the coming keyframe of the worlds that are `live`, 1.0 behind
        those that one needs.
        """
        missing = width - self._numbers.shape[2]
        if missing > 0:
            room = (0, 0), (0, 0), (0, missing)
            self._numbers = np.pad(self._numbers, room, constant_values=1.0)
        place = self._used % _KEYFRAMES
        for world in np.flatnonzero(live & (place == 0)).tolist():
            self._fill(world)
        self._used += live
        return self._numbers[np.arange(len(live)), place, :width]

    def _fill(self, world: int) -> None:
        stream = self._streams[world]
        if stream is not None:
            generator, numbers = stream
            self._numbers[world] = 1.0
            self._numbers[world, :, :numbers] = self._draw(generator, _KEYFRAMES, numbers)
