"""False boxes: nothing of their class is there, and a single one says little of it. They ignore occlusion."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from care_sim.core.frames import Floats
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.types import ImageDetections
from care_sim.sensors.confidence import confidence_of, pixels_of

DUPLICATE_IOU = 0.5
"""Of two boxes of a class that overlap this much a detector reports one (non-maximum suppression,
PASCAL VOC).
"""
MOST_DRAWS = 8
"""Draws of a ghost before it is left out, because each lay on a box of its class."""
NEARER, ASIDE, MORE_HIDDEN = 0.05, 0.005, 0.05
"""How far a ghost departs at most from the box that it was: its distance along the camera's axis
and its hidden share by these factors, sideways by this share of the picture's width. Enough that
copies of a box are as rare as among true boxes, too little to leave their law.
"""

Rows = NDArray[np.int64]
_BOX = slice(2, 6)


@dataclass(frozen=True, eq=False)
class BoxPool:
    """True boxes seen another time, from which ghosts are made: `rows` (n, 9) as
    `ImageDetections.rows`, `times_s` (n,) when each was seen, `middles` (n, 2) of their pictures,
    `moments_s` (k,) when pictures were taken. At a moment those serve that were seen at least
    `apart_s` and at most `near_s` before or after it.
    """

    rows: Floats
    times_s: Floats
    middles: Floats
    moments_s: Floats
    apart_s: float = 0.0
    near_s: float = np.inf

    @classmethod
    def of(
        cls,
        seen: Sequence[ImageDetections],
        times_s: Sequence[float],
        cameras: Sequence[PinholeCamera],
        apart_s: float = 0.0,
        near_s: float = np.inf,
    ) -> "BoxPool":
        """All that `cameras` have `seen` (k,) at the moments `times_s` (k,)."""
        rows = np.concatenate([NO_ROWS, *(detections.rows() for detections in seen)])
        middles = np.array([(camera.width / 2, camera.height / 2) for camera in cameras]).reshape(
            -1, 2
        )
        moments = np.asarray(times_s, float)
        times = np.repeat(moments, [len(detections) for detections in seen])
        return cls(rows, times, middles[rows[:, 6].astype(np.int64)], moments, apart_s, near_s)

    def serving(self, time_s: float) -> Rows:
        """The rows that serve at a moment."""
        return np.flatnonzero(self._serves(self.times_s, time_s))

    def plenty(self, time_s: float) -> float:
        """How many boxes a picture holds at the moments that serve, over how many one holds at any."""
        pictures = np.count_nonzero(self._serves(self.moments_s, time_s))
        usual = len(self.rows) / max(len(self.moments_s), 1)
        return len(self.serving(time_s)) / pictures / usual if pictures and usual else 0.0

    def _serves(self, times_s: Floats, time_s: float) -> NDArray[np.bool_]:
        away = np.abs(times_s - time_s)
        serves: NDArray[np.bool_] = (away >= self.apart_s - 1e-9) & (away <= self.near_s + 1e-9)
        return serves

    def varied(self, rows: Rows, draws: Floats) -> Floats:
        """(k, 9) the boxes at `rows` (k,) as `draws` (k, 3) from 0 to 1 vary them: nearer or
        farther, aside, more or less hidden.

        What would leave the edges or the least confidence of the pool is varied the other way
        round, and what would leave them there too is not: so nothing heaps up at the borders. What
        the picture's edge cuts, it cuts after.
        """
        departures = (2 * draws - 1) * (NEARER, ASIDE, MORE_HIDDEN)
        (there, possible), (back, possible_back) = (
            self._moved(rows, departures),
            self._moved(rows, -departures),
        )
        varied: Floats = np.where(possible_back[:, None], back, self.rows[rows])
        return np.where(possible[:, None], there, varied)

    def _moved(self, rows: Rows, departures: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """(k, 9) the boxes after departures (k, 3), and (k,) which of them are within the pool's
        borders.
        """
        moved, middles, limits = self.rows[rows], self.middles[rows], self._limits[rows]
        boxes, (nearer, aside, hidden) = moved[:, _BOX].copy(), departures.T
        # An object that comes nearer along the camera's axis grows about the middle of the picture,
        # its foot stays on the road.
        ways = np.expm1(nearer)[:, None] * (boxes - np.tile(middles, 2))
        ways[:, [0, 2]] += (aside * 2 * middles[:, 0])[:, None]
        moved[:, _BOX] = after = np.where(
            boxes == limits, boxes, boxes + _rounded(ways, self._edge_step)
        )
        moved[:, 1] = confidences = self._confidences(rows, _areas(after), np.exp(hidden))
        within = (
            (after[:, :2] >= limits[:, :2])
            & (after[:, 2:] <= limits[:, 2:])
            & (after[:, :2] < after[:, 2:])
        )
        return moved, within.all(axis=1) & (confidences >= self.rows[:, 1].min())

    def _confidences(self, rows: Rows, areas: Floats, hidden: Floats) -> Floats:
        """(k,) of boxes that now have these areas: visible pixels grow with the area, hidden ones
        by `hidden`.
        """
        shares = self._pixels[rows] / _areas(self.rows[rows, _BOX])
        if self._counted:
            shares = 1 - (1 - shares) * hidden
            return confidence_of(np.clip(np.rint(shares * areas), 0, areas))
        return _rounded(confidence_of(shares * areas), self._confidence_step)

    @cached_property
    def _pixels(self) -> Floats:
        return pixels_of(self.rows[:, 1])

    @cached_property
    def _counted(self) -> bool:
        """Whether confidences come from whole pixels that the boxes hold."""
        return _step(self._pixels) == 1.0 and bool(
            np.all(self._pixels <= _areas(self.rows[:, _BOX]) + 0.5)
        )

    @cached_property
    def _confidence_step(self) -> float:
        return _step(self.rows[:, 1])

    @cached_property
    def _edge_step(self) -> float:
        """The step of the edges: 1 of rendered pictures, a few decimals of a detector's file, else
        0.
        """
        firsts = np.empty((len(self.rows), 4))
        for camera in np.unique(self.rows[:, 6]):
            own = self.rows[:, 6] == camera
            firsts[own] = np.tile(self.rows[own][0, 2:4], 2)
        return _step(self.rows[:, _BOX] - firsts)

    @cached_property
    def _limits(self) -> Floats:
        """(n, 4) the outermost edges of all boxes in the camera of each: the picture's own where it
        cuts one.
        """
        limits = np.empty((len(self.rows), 4))
        for camera in np.unique(self.rows[:, 6]):
            own = self.rows[:, 6] == camera
            boxes = self.rows[own, _BOX]
            limits[own] = np.concatenate([boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)])
        return limits


NO_ROWS = np.empty((0, len(ImageDetections.COLUMNS)))
EMPTY_POOL = BoxPool(NO_ROWS, np.empty(0), np.empty((0, 2)), np.empty(0))


class FalseBoxes:
    """False boxes by the law of the true ones: a Poisson number per keyframe, `rate` per picture on
    the mean over `cameras` pictures and all moments, more where the pool has more. Each is a box
    drawn evenly from what serves, and varied a little. So their classes, places, sizes, confidences
    and cameras are those of true boxes. They flicker: every keyframe has its own, and none lasts.
    And they say what any law of true boxes says, where objects tend to be: where people always
    emerge at one place, false people stand there too.

    A ghost that lies on another box of its class is drawn again, up to MOST_DRAWS times, then left
    out, as a detector suppresses duplicates. So fewer come where few places are free: up to 4 a
    picture hardly any is left out. None comes at a moment at which the pool has none. The draws do
    not depend on what is there: every policy meets the same.
    """

    def __init__(self, pool: BoxPool, rate: float, cameras: int, rng: np.random.Generator):
        self._pool, self._mean, self._rng = pool, rate * cameras, rng

    def draw(self, true: Floats, time_s: float) -> Floats:
        """(k, 9) the ghosts of the pictures of this keyframe, beside the `true` boxes (n, 9)."""
        if not self._mean:
            return NO_ROWS
        serving = self._pool.serving(time_s)
        draws = self._rng.random(
            (self._rng.poisson(self._mean * self._pool.plenty(time_s)), MOST_DRAWS, 4)
        )
        if not len(draws):
            return NO_ROWS
        picks = serving[(draws[..., 0] * len(serving)).astype(np.int64)]
        tried = self._pool.varied(picks.ravel(), draws[..., 1:].reshape(-1, 3)).reshape(
            *picks.shape, -1
        )
        shown = true
        for tries in tried:
            free = ~_on_another(tries, shown)
            if free.any():
                shown = np.concatenate([shown, tries[free.argmax()][None]])
        return shown[len(true) :]


def _on_another(boxes: Floats, others: Floats) -> NDArray[np.bool_]:
    """(k,) which of the rows `boxes` (k, 9) lie on one of `others` (n, 9) of their class and
    picture.
    """
    ours, theirs = boxes[:, None], others[None]
    low, high = (
        np.maximum(ours[..., 2:4], theirs[..., 2:4]),
        np.minimum(ours[..., 4:6], theirs[..., 4:6]),
    )
    common = np.prod(np.clip(high - low, 0, None), axis=-1)
    union = _areas(boxes[:, _BOX])[:, None] + _areas(others[:, _BOX]) - common
    alike = (ours[..., 0] == theirs[..., 0]) & (ours[..., 6] == theirs[..., 6])
    lies: NDArray[np.bool_] = (alike & (common >= DUPLICATE_IOU * union)).any(axis=1)
    return lies


def _areas(boxes: Floats) -> Floats:
    areas: Floats = np.prod(np.maximum(boxes[:, 2:] - boxes[:, :2], 0), axis=1)
    return areas


def _step(values: Floats) -> float:
    """The coarsest of 1, 0.1, ... 0.0001 of which all values are multiples, 0 where none is."""
    for digits in range(5):
        scaled = values * 10**digits
        if np.all(np.isfinite(scaled)) and np.all(np.abs(scaled - np.rint(scaled)) < 1e-6):
            return 10.0**-digits
    return 0.0


def _rounded(values: Floats, step: float) -> Floats:
    return np.rint(values / step) * step if step else values
