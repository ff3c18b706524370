"""What goes wrong between the pictures of all worlds and the detections that arrive, in each world
by its own faults; see `care_sim.sensors.camera`. Their random numbers are drawn for many
keyframes at once.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.conditions import CameraFaults
from care_sim.core.types import ImageDetections
from care_sim.loops.stages.state import filled
from care_sim.sensors.annotated import IdentifiedDetections
from care_sim.sensors.camera import first_bursts, later_bursts, miss_rates

# Numbers of a module are what compiled code can hold.
_AGE, _YAW_CHANGE = ImageDetections.AGE, ImageDetections.YAW_CHANGE


class Detected(NamedTuple):
    """Camera detections: `counts` (W,); `rows` (W, D, 9) in the order of
    `ImageDetections.COLUMNS`; and the `objects` (W, D) behind them, bodies or NO_OBJECT.
    """

    counts: Integers
    rows: Floats
    objects: Integers

    @classmethod
    def of(cls, worlds: int, most: int) -> "Detected":
        """Tables for so many of each world."""
        rows = np.zeros((worlds, most, len(ImageDetections.COLUMNS)))
        return cls(np.zeros(worlds, np.int64), rows, np.zeros((worlds, most), np.int64))

    def put(self, world: int, arrived: IdentifiedDetections) -> "Detected":
        """Write those of a world; longer tables, if they need more room than there is."""
        self.counts[world] = len(arrived)
        rows = filled(self.rows, world, arrived.detections.rows())
        return Detected(self.counts, rows, filled(self.objects, world, arrived.objects))


class BatchMisses:
    """Which of the reported bodies the cameras miss; the numbers are those of
    `care_sim.sensors.camera.Misses`.
    """

    def __init__(self, faults: Sequence[CameraFaults]):
        worlds = len(faults)
        told = [(one.false_negative_rate, one.false_negative_per_m) for one in faults]
        self._shares = np.array(told)[:, :, None]
        self._bursts = np.array([[one.false_negative_burst] for one in faults])
        self._draws = DrawnAhead(worlds)
        self._lasting = np.zeros((worlds, 0), np.int64)
        self._started = np.zeros(worlds, np.bool_)
        self.any = bool(self._shares.any())
        """Whether any are ever missed."""

    def begin(self, world: int, seed: np.random.SeedSequence, objects: int) -> None:
        """Begin an episode with so many `objects` that can be missed."""
        if self.any:
            rng = np.random.default_rng(seed)
            self._draws.begin(world, partial(_uniform, rng, objects))
            self._started[world] = False

    def draw(self, live: Mask, ranges: Floats) -> Mask:
        """(W, R) who is missed at this keyframe of the worlds that are `live`; `ranges` (W, R) are
        distances in metres.
        """
        width = ranges.shape[1]
        lasting = self._lasting
        if lasting.shape[1] < width:
            lasting = np.pad(lasting, ((0, 0), (0, width - lasting.shape[1])))
        rates = miss_rates(self._shares[:, 0], self._shares[:, 1], ranges)
        draws = self._draws.next(live, width)
        first = first_bursts(rates, draws, self._bursts)
        later = later_bursts(lasting, rates, draws, self._bursts)
        drawn = np.where(self._started[:, None], later, first)
        missed: Mask = (drawn > 0) & live[:, None]
        self._lasting = np.where(live[:, None], drawn - missed, lasting)
        self._started |= live
        return missed


# No closures: a copy of the worlds then draws from copies of the generators.
def _uniform(rng: np.random.Generator, objects: int, keyframes: int) -> Floats:
    return rng.random((keyframes, objects))


def _below(rng: np.random.Generator, most: int, keyframes: int) -> Integers:
    return rng.integers(most, size=(keyframes, 1))


class _Sent(NamedTuple):
    """The pictures on their way, in a ring of L places each: `counts` (W, L), `rows`
    (W, L, D, 9) and `objects` (W, L, D) of their detections, the car's `headings` (W, L) when they
    were taken, and the keyframes at which they are `due` (W, L). `taken` (W,) counts them.
    """

    counts: Integers
    rows: Floats
    objects: Integers
    headings: Floats
    due: Integers
    taken: Integers


class BatchDelay:
    """Hands out the newest picture that has arrived, as `care_sim.sensors.camera.Delay`:
    each is late by its world's one of the `latencies` (W,), keyframes, and by 0 to that of the
    `jitters` (W,) more that are drawn for it.
    """

    def __init__(self, latencies: Integers, jitters: Integers, keyframe_s: float):
        worlds = len(latencies)
        self._latencies, self._jitters = latencies, jitters
        self._keyframe_s = keyframe_s
        self._draws = DrawnAhead(worlds)
        # The last one that has not come by now has come in any case.
        places = int((latencies + jitters).max()) + 1
        self._sent = _Sent(
            np.zeros((worlds, places), np.int64),
            np.empty((worlds, places, 0, len(ImageDetections.COLUMNS))),
            np.empty((worlds, places, 0), np.int64),
            np.zeros((worlds, places)),
            np.zeros((worlds, places), np.int64),
            np.zeros(worlds, np.int64),
        )
        self._arrived = Detected.of(worlds, 0)

    def begin(self, world: int, seed: np.random.SeedSequence) -> None:
        """Begin an episode; lateness is drawn from `seed`."""
        self._sent.taken[world] = 0
        if self._jitters.any():
            rng, most = np.random.default_rng(seed), self._jitters[world] + 1
            self._draws.begin(world, partial(_below, rng, most))

    def newest(self, live: Mask, seen: Detected, headings: Floats) -> Detected:
        """Take in what is `seen` at a keyframe of the worlds that are `live`, the cars with these
        `headings` (W,), radians; the newest detections that are due, with age and yaw change.
        """
        late = self._latencies
        if self._jitters.any():
            late = late + self._draws.next(live, 1)[:, 0].astype(np.int64)
        worlds, most, columns = seen.rows.shape
        places, room = self._sent.rows.shape[1:3]
        if room < most:
            rows = np.empty((worlds, places, most, columns))
            objects = np.empty((worlds, places, most), np.int64)
            rows[:, :, :room], objects[:, :, :room] = self._sent.rows, self._sent.objects
            self._sent = self._sent._replace(rows=rows, objects=objects)
            self._arrived = Detected.of(worlds, most)
        _deliver(live, seen, headings, late, self._keyframe_s, self._sent, self._arrived)
        return self._arrived


@compiled()
def _deliver(
    live: Mask,
    seen: Detected,
    headings: Floats,
    late: Integers,
    keyframe_s: float,
    sent: _Sent,
    arrived: Detected,
) -> None:
    """See `BatchDelay.newest`."""
    places = sent.due.shape[1]
    for w in range(len(live)):
        if not live[w]:
            continue
        keyframe = sent.taken[w]
        place = keyframe % places
        sent.taken[w] += 1
        sent.due[w, place] = keyframe + late[w]
        sent.headings[w, place] = headings[w]
        sent.counts[w, place] = seen.counts[w]
        for n in range(seen.counts[w]):
            sent.rows[w, place, n] = seen.rows[w, n]
            sent.objects[w, place, n] = seen.objects[w, n]

        # The newest first. Jitter lets a picture overtake the ones before it, which are then never
        # handed out: what has been due once is so later.
        arrived.counts[w] = 0
        for age in range(min(keyframe + 1, places)):
            place = (keyframe - age) % places
            if sent.due[w, place] <= keyframe:
                arrived.counts[w] = sent.counts[w, place]
                for n in range(sent.counts[w, place]):
                    arrived.rows[w, n] = sent.rows[w, place, n]
                    arrived.objects[w, n] = sent.objects[w, place, n]
                    arrived.rows[w, n, _AGE] = age * keyframe_s
                    arrived.rows[w, n, _YAW_CHANGE] = headings[w] - sent.headings[w, place]
                break


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
