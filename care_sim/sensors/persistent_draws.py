"""Random numbers that last: what a detector gets wrong now, it gets wrong a moment later."""

import numpy as np
from numpy.typing import ArrayLike

from care_sim.core.arrays import Floats


class PersistentDraws:
    """Numbers (n, k) from 0 to 1, k of each of n objects, evenly distributed at every keyframe.

    From one keyframe to the next each stays with the chance exp(-keyframe / time) and else is drawn
    anew. So the autocorrelation of whatever is made of one number alone is exp(-t / time), as long
    as what it is made with stays. Two draws are taken for each at every keyframe, seen or not, so
    that every policy meets the same.
    """

    def __init__(
        self,
        objects: int,
        times_s: ArrayLike,
        keyframe_s: float,
        rng: np.random.Generator,
    ):
        """`times_s` (k,) are the correlation times in seconds."""
        self._stays = np.exp(-keyframe_s / np.asarray(times_s, float))
        self._rng = rng
        self._numbers = rng.random((objects, len(self._stays)))
        self._started = False

    def next(self) -> Floats:
        """(n, k) the numbers of the next keyframe, read-only by agreement."""
        if self._started:
            stays, fresh = self._rng.random((2, *self._numbers.shape))
            self._numbers = np.where(stays < self._stays, self._numbers, fresh)
        self._started = True
        return self._numbers
