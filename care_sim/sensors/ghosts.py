"""Ghosts: false boxes that last, and move as an object of their kind moves."""

from dataclasses import dataclass

import numpy as np

from care_sim.base.times import LAST_BITS_S
from care_sim.core.arrays import Floats, Integers
from care_sim.sensors.box_pool import NO_ROWS, BoxPool
from care_sim.sensors.false_boxes import without_duplicates


@dataclass(frozen=True)
class _Ghost:
    """It follows the pool's `object` in the pictures of its `camera`, which were taken `later_s`
    seconds after those in which it is shown; `draws` (3,) vary its boxes.
    """

    object: int
    camera: int
    later_s: float
    draws: Floats


class Ghosts:
    """False boxes that are born, follow an object of the pool, and end.

    `rate` of them are there per picture on the mean, each for `time_s` seconds on the mean; lives
    are exponentially distributed, and end when the pool's object leaves its pictures. A ghost is
    born as one of the boxes that are usable then, varied a little, and shows what became of that
    object later. So it moves as something of its kind that the car passes. While it lies on another
    box of its class it is not shown, as a detector suppresses duplicates. What is drawn does not
    depend on what is there: every policy meets the same ghosts.
    """

    def __init__(
        self,
        pool: BoxPool,
        rate: float,
        time_s: float,
        keyframe_s: float,
        cameras: int,
        rng: np.random.Generator,
    ):
        self._pool = pool
        self._mean = rate * cameras
        self._stays = float(np.exp(-keyframe_s / time_s))
        self._rng = rng
        self._alive: list[_Ghost] = []
        self._started = False

    def draw(self, shown: Floats, time_s: float) -> Floats:
        """(k, 9) the ghosts in the pictures of this keyframe, beside the boxes `shown` (n, 9)."""
        stay = self._rng.random(len(self._alive)) < self._stays
        self._alive = [one for one, stays in zip(self._alive, stay, strict=True) if stays]
        # As many are born as end on the mean. The first picture has those of the long run.
        born = self._rng.poisson(self._mean * (1 - self._stays if self._started else 1.0))
        self._started = True
        self._alive += self._born(self._rng.random((born, 4)), time_s)

        # One whose object is out of the pool's picture has ended too.
        rows = [self._row(one, time_s) for one in self._alive]
        self._alive = [one for one, row in zip(self._alive, rows, strict=True) if row is not None]
        if not self._alive:
            return NO_ROWS
        places = np.array([row for row in rows if row is not None], np.int64)
        varied = self._pool.varied(places, np.array([one.draws for one in self._alive]))
        return without_duplicates(varied[:, None], shown)

    def _born(self, draws: Floats, time_s: float) -> list[_Ghost]:
        """A ghost for every row of `draws` (k, 4): one picks its box, three vary it."""
        pool = self._pool
        usable = pool.usable(time_s)
        if not len(usable):
            return []
        picks: Integers = usable[(draws[:, 0] * len(usable)).astype(np.int64)]
        return [
            _Ghost(
                int(pool.objects[row]),
                int(pool.cameras[row]),
                float(pool.times_s[row]) - time_s,
                own,
            )
            for row, own in zip(picks.tolist(), draws[:, 1:], strict=True)
        ]

    def _row(self, ghost: _Ghost, time_s: float) -> int | None:
        """The box of the pool that a ghost shows now, None if there is none any more."""
        pool = self._pool
        is_now = np.abs(pool.times_s - time_s - ghost.later_s) <= LAST_BITS_S
        is_own = (pool.objects == ghost.object) & (pool.cameras == ghost.camera)
        rows = np.flatnonzero(is_now & is_own)
        return int(rows[0]) if len(rows) else None
