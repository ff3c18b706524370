"""False boxes: nothing of their class is there, and a single one says little of it.

They ignore occlusion: one may lie where a true object of its distance would be hidden.
"""

import numpy as np

from care_sim.core.arrays import Floats, Mask
from care_sim.core.types import ImageDetections
from care_sim.sensors.box_pool import NO_ROWS, BoxPool, box_areas

DUPLICATE_IOU = 0.5
"""Of two boxes of a class that overlap this much a detector reports one (non-maximum suppression,
PASCAL VOC).
"""
MOST_DRAWS = 8
"""Draws of a false box before it is left out, because each lay on a box of its class."""


class FalseBoxes:
    """False boxes that are distributed as the true ones are.

    A Poisson number comes per keyframe: `rate` per picture on the mean over `cameras` pictures and
    all times, more where the pool has more. Each is a box drawn evenly from the usable ones of the
    pool, and varied a little. So classes, places, sizes, confidences and cameras are those of true
    boxes. They flicker: every keyframe has its own, and none lasts. Where people always emerge at
    one place, false people are there too.

    A false box that lies on another box of its class is drawn again, up to MOST_DRAWS times, then
    left out, as a detector suppresses duplicates. So fewer come where few places are free; up to a
    rate of 4 hardly any is left out. None comes at a time at which the pool has none. The draws do
    not depend on what is there: every policy meets the same.
    """

    def __init__(self, pool: BoxPool, rate: float, cameras: int, rng: np.random.Generator):
        self._pool = pool
        self._mean = rate * cameras
        self._rng = rng

    def draw(self, true: Floats, time_s: float) -> Floats:
        """(k, 9) the false boxes of this keyframe's pictures, beside the `true` boxes (n, 9)."""
        if not self._mean:
            return NO_ROWS
        usable = self._pool.usable(time_s)
        number = self._rng.poisson(self._mean * self._pool.relative_density(time_s))
        # All draws at once, tried or not: what is there must not move the ones that follow.
        draws = self._rng.random((number, MOST_DRAWS, 4))
        if not number:
            return NO_ROWS
        # A draw from 0 to 1 picks each of the usable boxes with equal chance; three vary it.
        picks = usable[(draws[..., 0] * len(usable)).astype(np.int64)]
        varied = self._pool.varied(picks.ravel(), draws[..., 1:].reshape(-1, 3))
        return without_duplicates(varied.reshape(*picks.shape, -1), true)


def without_duplicates(tries: Floats, true: Floats) -> Floats:
    """(j, 9) of each of k boxes its first of m `tries` (k, m, 9) that lies on none of the `true`
    boxes (n, 9) of its class and picture, and on none of those before it; boxes without such a try
    are left out.
    """
    shown = true
    for own in tries:
        is_free = ~_lie_on(own, shown)
        if is_free.any():
            shown = np.concatenate([shown, own[is_free.argmax()][None]])
    return shown[len(true) :]


def _lie_on(boxes: Floats, others: Floats) -> Mask:
    """(k,) which of the rows `boxes` (k, 9) lie on one of `others` (n, 9) of their class and
    picture.
    """
    columns = ImageDetections
    ours = boxes[:, None]
    theirs = others[None]

    # Left and top, then right and bottom, of what two boxes have in common.
    low = np.maximum(ours[..., columns.BOX][..., :2], theirs[..., columns.BOX][..., :2])
    high = np.minimum(ours[..., columns.BOX][..., 2:], theirs[..., columns.BOX][..., 2:])
    common = np.prod(np.clip(high - low, 0, None), axis=-1)
    areas = box_areas(boxes[:, columns.BOX])[:, None] + box_areas(others[:, columns.BOX])
    union = areas - common
    alike = ours[..., columns.CLASS] == theirs[..., columns.CLASS]
    alike &= ours[..., columns.CAMERA] == theirs[..., columns.CAMERA]
    # Multiplied out, so that boxes without an area divide nothing.
    lies: Mask = (alike & (common >= DUPLICATE_IOU * union)).any(axis=1)
    return lies
