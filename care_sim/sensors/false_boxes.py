"""False boxes: nothing of their class is there, and a single one says little of it.

They ignore occlusion: one may lie where a true object of its distance would be hidden.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from care_sim.base.times import LAST_BITS_S
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.types import ImageDetections
from care_sim.sensors.annotated import IdentifiedDetections
from care_sim.sensors.pictures import confidence_of, pixels_of

NEARER = 0.05
"""How far a varied box departs at most from the true one: its distance along the camera's axis by
this factor. Enough that copies of a box are as rare as among true boxes, too little to change how
true boxes are distributed; the same holds for the two below.
"""
ASIDE = 0.005
"""Sideways, by this share of the picture's width."""
MORE_HIDDEN = 0.05
"""Its hidden share, by this factor."""

_BOX = ImageDetections.BOX
_CAMERA = ImageDetections.CAMERA
_CONFIDENCE = ImageDetections.CONFIDENCE

NO_ROWS = np.empty((0, len(ImageDetections.COLUMNS)))


@dataclass(frozen=True, eq=False)
class BoxPool:
    """Boxes of other times, from which false boxes are drawn. `rows` (n, 9) are as
    `ImageDetections.rows`, seen at `times_s` (n,). `middles` (n, 2) are the middles of their
    pictures in pixels. `picture_times_s` (k,) are the times of pictures, `objects` (n,) the object
    or body behind each box.

    A box is usable if it was seen at least `apart_s` and at most `near_s` before or after the
    current time.
    """

    rows: Floats
    times_s: Floats
    middles: Floats
    picture_times_s: Floats
    objects: Integers
    apart_s: float = 0.0
    near_s: float = np.inf

    @classmethod
    def of(
        cls,
        seen: Sequence[IdentifiedDetections],
        times_s: Sequence[float],
        cameras: Sequence[PinholeCamera],
        apart_s: float = 0.0,
        near_s: float = np.inf,
    ) -> "BoxPool":
        """All that `cameras` have `seen` (k,) at the times `times_s` (k,)."""
        rows = np.concatenate([NO_ROWS, *(one.detections.rows() for one in seen)])
        middles = np.array([(camera.width / 2, camera.height / 2) for camera in cameras])
        own_middles = middles.reshape(-1, 2)[rows[:, _CAMERA].astype(np.int64)]
        picture_times = np.asarray(times_s, float)
        times = np.repeat(picture_times, [len(one) for one in seen])
        objects = np.concatenate([np.empty(0, np.int64), *(one.objects for one in seen)])
        return cls(rows, times, own_middles, picture_times, objects, apart_s, near_s)

    @cached_property
    def cameras(self) -> Integers:
        """(n,) the place of the camera of each box."""
        return self.rows[:, _CAMERA].astype(np.int64)

    def usable(self, time_s: float) -> Integers:
        """The rows that are usable at a time."""
        return np.flatnonzero(self._is_usable(self.times_s, time_s))

    def relative_density(self, time_s: float) -> float:
        """Boxes per picture among the usable ones, over boxes per picture of the whole pool."""
        pictures = np.count_nonzero(self._is_usable(self.picture_times_s, time_s))
        # Relative to the pool as a whole: the stated rate of false boxes holds for its mean.
        usual = len(self.rows) / max(len(self.picture_times_s), 1)
        return len(self.usable(time_s)) / pictures / usual if pictures and usual else 0.0

    def varied(self, rows: Integers, draws: Floats) -> Floats:
        """Return (k, 9) the boxes at `rows` (k,), varied by `draws` (k, 3) from 0 to 1: distance,
        side, hidden share.

        A variation that would leave the edges or the least confidence of the pool is inverted. If
        the inverse also leaves them, the box stays as it was. So nothing heaps up at these bounds.
        An edge that the picture cuts stays cut.
        """
        # The second choice is the opposite variation, the last the box as it was.
        departures = (2 * draws - 1) * (NEARER, ASIDE, MORE_HIDDEN)
        first, first_fits = self._moved(rows, departures)
        second, second_fits = self._moved(rows, -departures)
        varied: Floats = np.where(second_fits[:, None], second, self.rows[rows])
        return np.where(first_fits[:, None], first, varied)

    def _is_usable(self, times_s: Floats, time_s: float) -> Mask:
        # Before and after alike: the film or drive of other boxes is known as a whole.
        away = np.abs(times_s - time_s)
        is_apart = away >= self.apart_s - LAST_BITS_S
        is_near = away <= self.near_s + LAST_BITS_S
        usable: Mask = is_apart & is_near
        return usable

    def _moved(self, rows: Integers, departures: Floats) -> tuple[Floats, Mask]:
        """Return (k, 9) the boxes at `rows` (k,) after `departures`, and (k,) which of them stay
        within the bounds of the pool. `departures` (k, 3) are log factors of nearness and of the
        hidden share; between them the shift to the right, as a share of the picture's width.
        """
        moved = self.rows[rows]
        boxes = moved[:, _BOX].copy()
        middles = self.middles[rows]
        limits = self._limits[rows]
        nearer, sideways, hidden = departures.T

        # An object that comes nearer along the camera's axis grows about the middle of the picture,
        # and its foot stays on the road: a point at the height h below the camera appears f h / d
        # below the middle, so all of the box grows as 1 / d. The distance d varies by
        # exp(-nearer): a factor is as likely as its inverse. So an edge at e from the middle goes
        # to exp(nearer) e, that is by (exp(nearer) - 1) e = expm1(nearer) e.
        shifts = np.expm1(nearer)[:, None] * (boxes - np.tile(middles, 2))
        widths = 2 * middles[:, 0]
        shifts[:, [0, 2]] += (sideways * widths)[:, None]

        # An edge on the limit is where the picture cuts the object, which reaches beyond it: this
        # edge stays where it is.
        is_cut = boxes == limits
        after = np.where(is_cut, boxes, boxes + _rounded(shifts, self._edge_step))
        moved[:, _BOX] = after
        moved[:, _CONFIDENCE] = self._confidences(rows, box_areas(after), np.exp(hidden))

        # Within means inside the picture, the right way round, and no less sure than the least sure
        # box of the pool.
        low, high = after[:, :2], after[:, 2:]
        within = (low >= limits[:, :2]) & (high <= limits[:, 2:]) & (low < high)
        sure = moved[:, _CONFIDENCE] >= self.rows[:, _CONFIDENCE].min()
        return moved, within.all(axis=1) & sure

    def _confidences(self, rows: Integers, areas: Floats, hidden: Floats) -> Floats:
        """(k,) of boxes that now have these areas: visible pixels grow with the area, hidden ones
        by the factor `hidden`.
        """
        shares = self._pixels[rows] / box_areas(self.rows[rows, _BOX])
        if self._is_counted:
            shares = 1 - (1 - shares) * hidden
            return confidence_of(np.clip(np.rint(shares * areas), 0, areas))
        return _rounded(confidence_of(shares * areas), self._confidence_step)

    @cached_property
    def _pixels(self) -> Floats:
        return pixels_of(self.rows[:, _CONFIDENCE])

    @cached_property
    def _is_counted(self) -> bool:
        """Whether confidences come from whole pixels that the boxes hold."""
        is_whole = _decimal_step(self._pixels) == 1.0
        # Half a pixel for what rounding a confidence leaves open.
        return is_whole and bool(np.all(self._pixels <= box_areas(self.rows[:, _BOX]) + 0.5))

    @cached_property
    def _confidence_step(self) -> float:
        return _decimal_step(self.rows[:, _CONFIDENCE])

    @cached_property
    def _edge_step(self) -> float:
        """The step of the edges: 1 of rendered pictures, a few decimals of a detector's file, else
        0.
        """
        # Relative to a first box per camera: a picture that is cut or scaled begins at any number.
        firsts = np.empty((len(self.rows), 4))
        for own in self._by_camera():
            firsts[own] = np.tile(self.rows[own][0, _BOX][:2], 2)
        return _decimal_step(self.rows[:, _BOX] - firsts)

    @cached_property
    def _limits(self) -> Floats:
        """(n, 4) the outermost edges of all boxes in the camera of each: the picture's own where it
        cuts one.
        """
        limits = np.empty((len(self.rows), 4))
        for own in self._by_camera():
            boxes = self.rows[own, _BOX]
            limits[own] = np.concatenate([boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)])
        return limits

    def _by_camera(self) -> list[Mask]:
        """(n,) the rows of each camera."""
        cameras = self.rows[:, _CAMERA]
        return [cameras == camera for camera in np.unique(cameras)]


EMPTY_POOL = BoxPool(NO_ROWS, np.empty(0), np.empty((0, 2)), np.empty(0), np.empty(0, np.int64))


def box_areas(boxes: Floats) -> Floats:
    """(n,) of image boxes (n, 4), square pixels."""
    areas: Floats = np.prod(np.maximum(boxes[:, 2:] - boxes[:, :2], 0), axis=1)
    return areas


def _decimal_step(values: Floats) -> float:
    """The coarsest of 1, 0.1, ... 0.0001 of which all values are multiples, 0 where none is."""
    for digits in range(5):
        # Decimal fractions are not exact in binary, so a multiple is one within a tolerance.
        scaled = values * 10**digits
        if np.all(np.isfinite(scaled)) and np.all(np.abs(scaled - np.rint(scaled)) < 1e-6):
            return 10.0**-digits
    return 0.0


def _rounded(values: Floats, step: float) -> Floats:
    return np.rint(values / step) * step if step else values


DUPLICATE_IOU = 0.5
"""Overlap above which a detector reports one of two boxes of a class (non-maximum suppression,
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
    """Return (j, 9) the first free one of the m `tries` (k, m, 9) of each of k boxes. A try is free
    if it lies on none of the `true` boxes (n, 9) of its class and picture, and on none of those
    before it. Boxes without a free try are left out.
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
