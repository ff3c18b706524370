"""Random numbers of many worlds, from a stream each, drawn for many keyframes at once."""

from collections.abc import Callable

import numpy as np

from care_sim.core.arrays import Floats, Mask

_KEYFRAMES = 64
"""For how many keyframes numbers are drawn at once."""


Draw = Callable[[int], np.ndarray]
"""Gives the rows (k, n) of the next k keyframes of a world, n always the same; for a generator of
NumPy they are those of k calls for one.
"""


class DrawnAhead:
    """A row of numbers per world and keyframe, as long as the most that a world needs."""

    def __init__(self, worlds: int):
        self._draws: list[Draw | None] = [None] * worlds
        self._numbers = np.zeros((worlds, _KEYFRAMES, 0))
        self._used = np.zeros(worlds, np.int64)

    def begin(self, world: int, draw: Draw) -> None:
        """Begin an episode whose numbers `draw` gives."""
        self._draws[world] = draw
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
        draw = self._draws[world]
        if draw is not None:
            rows = draw(_KEYFRAMES)
            self._numbers[world] = 1.0
            self._numbers[world, :, : rows.shape[1]] = rows
