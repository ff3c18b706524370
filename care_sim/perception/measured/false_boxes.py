"""False boxes of a measured detector: they are born, stay where they are in the world, and end.

At every keyframe as many are there on average as were measured, by class and distance. A part of
them lasts (`lasting`, `lasts_s`), the rest is there for `flash_s`. Their numbers, places about the
car, scores and ends are drawn by the episode's seed and the keyframe alone: cars that drive alike
meet the same.
"""

from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.cells.stack import Grid
from care_sim.core.frames import Frame
from care_sim.core.types import Detections
from care_sim.perception.matching import MATCH_M
from care_sim.perception.measured.tables import FalseBoxes, Measurement
from care_sim.sensors.annotated import Annotations, Cloud

RING_M = 10.0
"""Distances are known by rings of so many metres."""
REACH_M = 50.0
"""No false box was counted beyond."""
FREE_WIDTH_M, FREE_LENGTH_M = 3.0, 20.0
"""The road ahead on which false boxes are rare, wide and long. Of 1,342 from a score of 0.3 on, 0
were there, where 8.5 would have been if false boxes were evenly spread over all directions."""
_NUMBERS = 9
"""Random numbers per birth: distance, direction, score, three sizes, yaw, end, and whether it is
kept on the road ahead."""
_AT_ONCE = 64
"""Keyframes whose births are drawn at once, for speed."""


class Directions(NamedTuple):
    """All cells of a grid by ascending azimuth, and the directions in which they look."""

    cells: Integers
    azimuths: Floats
    elevations: Floats


def score_at(rates: Floats, share: Floats) -> Floats:
    """(n,) the scores from which on there are `share` (n,) of all boxes; `rates` (k, 2) are score
    and boxes per keyframe from it on. Between two, and beyond the last, the logarithm of the rate
    is a line.
    """
    scores, logs = rates[::-1, 0], np.log(rates[::-1, 1])
    wanted = np.log(np.maximum(share, 1e-12)) + logs[-1]
    beyond = scores[0] + (wanted - logs[0]) * (scores[1] - scores[0]) / (logs[1] - logs[0])
    return np.asarray(np.where(wanted < logs[0], beyond, np.interp(wanted, logs, scores)))


class FalseBoxPopulation:
    """The false boxes of one episode with scores of `least_score` or more, a sensor that stands
    `sensor_height_m` above the road, and keyframes `keyframe_s` apart.
    """

    def __init__(
        self,
        measured: Measurement,
        least_score: float,
        grid: Grid,
        sensor_height_m: float,
        keyframe_s: float,
        seed: np.random.SeedSequence,
    ):
        self._measured = measured
        kinds = [_from(one, least_score) for one in measured.false_boxes]
        self._kinds = [one for one in kinds if one is not None]
        around = 360.0 / measured.view_deg
        rates = np.array([one.rates[0, 1] for one in self._kinds]) * around
        lasting = np.array([one.lasting for one in self._kinds])
        lives = np.array([one.lasts_s for one in self._kinds])
        # Both kinds of each class: those that last, then the others.
        self._means = np.concatenate([rates * lasting, rates * (1 - lasting)])
        self._lives = np.concatenate([lives, np.full(len(lives), measured.flash_s)])
        self._ends = 1 - _left(keyframe_s, self._lives)
        self._keyframe_s = keyframe_s
        self._height_m = sensor_height_m
        self._rng = np.random.default_rng(seed)
        x, y, z = grid.directions.T
        azimuths = np.arctan2(y, x)
        order = np.argsort(azimuths)
        self._looks = Directions(order, azimuths[order], np.arctan2(z, np.hypot(x, y))[order])
        self._table = np.empty((0, 12))
        """Per living box: class, world box (7), score, last keyframe, whether it is kept ahead,
        first keyframe."""
        self._coming, self._bounds = self._table, [0]

    def draw(self, keyframe: int, sensor: Frame, cloud: Cloud, present: Annotations) -> Detections:
        """The false boxes of a keyframe, with scores in the detector's own scale.

        Nothing comes from nothing: a box is reported where a return lies in its direction. Within
        MATCH_M of an object of its class a box is a detection of that object, and none is false.
        """
        self._live_on(keyframe, sensor)
        boxes = sensor.boxes_to_local(self._table[:, 1:8])
        kept = _shown(
            self._table,
            boxes,
            present.classes,
            np.ascontiguousarray(present.boxes, float),
            cloud.cells,
            self._looks,
        )
        rows = self._table[kept]
        none = np.zeros(len(kept), np.int64)
        return Detections(rows[:, 0].astype(np.int64), boxes[kept], none, rows[:, 8])

    def _live_on(self, keyframe: int, sensor: Frame) -> None:
        """Drop what has ended, and put what is born into the world about the `sensor`."""
        if keyframe % _AT_ONCE == 0:
            self._coming = self._born(keyframe)
            births = np.arange(keyframe, keyframe + _AT_ONCE + 1)
            self._bounds = np.searchsorted(self._coming[:, 11], births).tolist()
        first, last = self._bounds[keyframe % _AT_ONCE : keyframe % _AT_ONCE + 2]
        alive = self._table
        if len(alive):
            alive = alive[alive[:, 9] >= keyframe]
        if last > first:
            born = self._coming[first:last]
            born[:, 1:8] = sensor.boxes_to_world(born[:, 1:8])
            alive = np.concatenate([alive, born])
        self._table = alive

    def _born(self, keyframe: int) -> Floats:
        """The births of the keyframes from this one on, about the sensor; the last column tells
        when.
        """
        from scipy.special import ndtri

        # The first keyframe has those of the long run; then as many are born as end.
        means = np.tile(self._means * self._ends, (_AT_ONCE, 1))
        if keyframe == 0:
            means[0] = self._means
        counts = self._rng.poisson(means)
        draws = self._rng.random((int(counts.sum()), _NUMBERS))
        table = np.empty((len(draws), 12))
        kinds = np.repeat(np.tile(np.arange(counts.shape[1]), _AT_ONCE), counts.ravel())
        table[:, 11] = born = keyframe + np.repeat(np.arange(_AT_ONCE), counts.sum(axis=1))
        away = np.empty(len(draws))
        for number in np.unique(kinds).tolist():
            own = kinds == number
            kind = self._kinds[number % len(self._kinds)]
            edges = np.concatenate([[0.0], np.cumsum(kind.distances)])
            away[own] = RING_M * np.interp(draws[own, 0], edges, np.arange(len(edges)))
            means, spreads = kind.log_sizes.T
            table[own, 0] = kind.label
            table[own, 4:7] = np.exp(means + spreads * ndtri(draws[own, 3:6]))
            table[own, 8] = np.minimum(
                score_at(kind.rates, draws[own, 2]), self._measured.most_score
            )
        azimuths = 2 * np.pi * draws[:, 1]
        table[:, 1] = away * np.cos(azimuths)
        table[:, 2] = away * np.sin(azimuths)
        table[:, 3] = table[:, 6] / 2 - self._height_m
        table[:, 7] = 2 * np.pi * draws[:, 6]
        # It is there at this keyframe, and at the next ones as long as its exponential life lasts.
        lives = -self._lives[kinds] * np.log(np.maximum(draws[:, 7], 1e-300))
        table[:, 9] = born + np.floor(lives / self._keyframe_s)
        table[:, 10] = draws[:, 8] < self._measured.kept_ahead
        return table


def _from(kind: FalseBoxes, least_score: float) -> FalseBoxes | None:
    """The kind with rates from `least_score` on; None where there are none."""
    scores, rates = kind.rates.T
    if least_score > scores[-1]:
        return None
    least = np.exp(np.interp(least_score, scores, np.log(rates)))
    higher = kind.rates[scores > least_score]
    if not len(higher):
        return None
    return kind._replace(rates=np.concatenate([[[least_score, least]], higher]))


def _left(seconds: float, lives: Floats) -> Floats:
    """(n,) the shares that are left after so many seconds; nothing of a life of 0."""
    return np.exp(-seconds / np.maximum(lives, 1e-9))


@compiled()
def _shown(
    table: Floats,
    boxes: Floats,
    present_classes: Integers,
    present: Floats,
    cells: Integers,
    looks: Directions,
) -> Integers:
    """The rows (k,) of the `table` (n, 12) that are reported, with `boxes` (n, 7) in the sensor
    frame, beside `present` objects and with returns to the `cells` (P,).
    """
    returned = np.zeros(len(looks.cells), np.bool_)
    for cell in cells:
        returned[cell] = True
    shown = np.empty(len(boxes), np.int64)
    count = 0
    for n in range(len(boxes)):
        x, y = boxes[n, 0], boxes[n, 1]
        ahead = 0.0 < x < FREE_LENGTH_M and abs(y) < FREE_WIDTH_M / 2
        if np.hypot(x, y) > REACH_M or (ahead and not table[n, 10]):
            continue
        if _is_of_another(x, y, table[n, 0], present_classes, present):
            continue
        if _is_looked_at(boxes[n], returned, looks):
            shown[count] = n
            count += 1
    return shown[:count]


@compiled()
def _is_of_another(x: float, y: float, label: float, classes: Integers, boxes: Floats) -> bool:
    """Whether a box at x, y is within MATCH_M of one of `boxes` (n, 7) of its class."""
    for row in range(len(boxes)):
        away = np.hypot(x - boxes[row, 0], y - boxes[row, 1])
        if classes[row] == label and away <= MATCH_M:
            return True
    return False


@compiled()
def _is_looked_at(box: Floats, returned: Mask, looks: Directions) -> bool:
    """Whether a cell that `returned` (N,) looks in the direction of a `box` (7,)."""
    away = np.hypot(box[0], box[1])
    wide = np.arctan2(max(box[3], box[4]) / 2, away)
    high = np.arctan2(box[5] / 2, away)
    azimuth, elevation = np.arctan2(box[1], box[0]), np.arctan2(box[2], away)
    for turn in (-2 * np.pi, 0.0, 2 * np.pi):
        first = np.searchsorted(looks.azimuths, azimuth + turn - wide)
        for place in range(first, len(looks.azimuths)):
            if looks.azimuths[place] > azimuth + turn + wide:
                break
            near = abs(looks.elevations[place] - elevation) <= high
            if near and returned[looks.cells[place]]:
                return True
    return False
