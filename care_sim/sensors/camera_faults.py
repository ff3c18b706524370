"""Camera faults of W worlds: misses, delays and lost detections, per world. Random numbers are
drawn for many keyframes at once.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers, Mask, filled
from care_sim.core.conditions import CameraFaults
from care_sim.core.types import ImageDetections
from care_sim.sensors.annotated import IdentifiedDetections

# Compiled code can only read module-level constants.
_AGE, _YAW_CHANGE = ImageDetections.AGE, ImageDetections.YAW_CHANGE


class Detected(NamedTuple):
    """Camera detections of W worlds: `counts` (W,), `rows` (W, D, 9) in the order of
    `ImageDetections.COLUMNS`, and `objects` (W, D), bodies or NO_OBJECT.
    """

    counts: Integers
    rows: Floats
    objects: Integers

    @classmethod
    def of(cls, worlds: int, most: int) -> "Detected":
        """Return empty tables for this many detections per world."""
        rows = np.zeros((worlds, most, len(ImageDetections.COLUMNS)))
        return cls(np.zeros(worlds, np.int64), rows, np.zeros((worlds, most), np.int64))

    def put(self, world: int, arrived: IdentifiedDetections) -> "Detected":
        """Write a world's detections. Returns longer tables if they need more room."""
        self.counts[world] = len(arrived)
        rows = filled(self.rows, world, arrived.detections.rows())
        return Detected(self.counts, rows, filled(self.objects, world, arrived.objects))

    def take(self, world: int) -> IdentifiedDetections:
        """Return a copy of a world's detections."""
        own = slice(self.counts[world])
        detections = ImageDetections.from_checked_rows(self.rows[world, own].copy())
        return IdentifiedDetections(detections, self.objects[world, own].copy())


@compiled(brief=True)
def place_of(body: int, objects: Integers) -> int:
    """Return the place of a body among `objects` (n,), -1 if it is none of them."""
    for place in range(len(objects)):
        if objects[place] == body:
            return place
    return -1


class Misses:
    """Draws which objects the cameras miss. The long-run share is as stated; misses last for bursts
    of keyframes. Each object takes one draw per keyframe, seen or not, so that every policy meets
    the same misses.
    """

    def __init__(self, faults: Sequence[CameraFaults]):
        worlds = len(faults)
        told = [(one.false_negative_rate, one.false_negative_per_m) for one in faults]
        self._shares = np.array(told)[:, :, None]
        self._bursts = np.array([[one.false_negative_burst] for one in faults])
        self._draws = DrawnAhead(worlds)
        # Keyframes for which each object's burst still lasts.
        self._lasting = np.zeros((worlds, 0), np.int64)
        self._started = np.zeros(worlds, np.bool_)
        self._is_any = bool(self._shares.any())

    def begin(self, world: int, seed: np.random.SeedSequence, objects: int) -> None:
        """Begin an episode with so many `objects` that can be missed."""
        if self._is_any:
            rng = np.random.default_rng(seed)
            self._draws.begin(world, partial(_uniform, rng, objects))
            self._started[world] = False

    def draw(self, live: Mask, ranges: Floats) -> Mask:
        """Return (W, R) which objects are missed at this keyframe of the `live` worlds. `ranges`
        (W, R) are metres.
        """
        if not self._is_any:
            return np.zeros(ranges.shape, np.bool_)
        width = ranges.shape[1]
        lasting = self._lasting
        if lasting.shape[1] < width:
            lasting = np.pad(lasting, ((0, 0), (0, width - lasting.shape[1])))
        # One draw per object decides all: whether it is missed, and at the start for how long.
        rates = miss_rates(self._shares[:, 0], self._shares[:, 1], ranges)
        draws = self._draws.next(live, width)
        first = first_bursts(rates, draws, self._bursts)
        later = later_bursts(lasting, rates, draws, self._bursts)
        drawn = np.where(self._started[:, None], later, first)
        missed: Mask = (drawn > 0) & live[:, None]
        self._lasting = np.where(live[:, None], drawn - missed, lasting)
        self._started |= live
        return missed


def miss_rates(rate: Floats, per_m: Floats, ranges: Floats) -> Floats:
    """Return the long-run share of missed keyframes at these distances, metres, any shape. Uses
    `false_negative_rate` and `false_negative_per_m`.
    """
    return np.minimum(rate + per_m * ranges, 1.0)


def first_bursts(rates: Floats, draws: Floats, burst: Integers) -> Integers:
    """Return for how many keyframes, from the first on, objects are missed. Arrays of rates and
    draws have one shape. The first keyframe shows the long run: an object is missed at its rate,
    and is equally likely at any keyframe of its burst.
    """
    hit = draws < rates
    # A draw below the rate, divided by it, is again evenly distributed from 0 to 1.
    share = np.divide(draws, rates, out=np.zeros_like(draws), where=hit)
    served = np.floor(burst * share).astype(np.int64)
    return np.where(hit, burst - served, 0)


def later_bursts(lasting: Integers, rates: Floats, draws: Floats, burst: Integers) -> Integers:
    """Return the same at a later keyframe, given the keyframes `lasting` of current bursts. Bursts
    begin among the objects that are in none.
    """
    # With the chance p that a burst of L keyframes begins, (1 - p) / p keyframes without one lie
    # between two bursts on the mean. The share of missed keyframes is L / (L + (1 - p) / p); it is
    # the rate r for p = r / (L - (L - 1) r).
    begins = (lasting == 0) & (draws < rates / (burst - (burst - 1) * rates))
    return np.where(begins, burst, lasting)


# No closures: a copy of the worlds then draws from copies of the generators.
def _uniform(rng: np.random.Generator, objects: int, keyframes: int) -> Floats:
    return rng.random((keyframes, objects))


def _below(rng: np.random.Generator, most: int, keyframes: int) -> Integers:
    return rng.integers(most, size=(keyframes, 1))


class _Sent(NamedTuple):
    """Pictures on their way, in a ring of L places per world. `counts` (W, L), `rows` (W, L, D, 9)
    and `objects` (W, L, D) are their detections. `headings` (W, L) are the car's when they were
    taken, `due` (W, L) the keyframes of arrival. `taken` (W,) counts pictures, `begun` (W,)
    keyframes.
    """

    counts: Integers
    rows: Floats
    objects: Integers
    headings: Floats
    due: Integers
    taken: Integers
    begun: Integers


class Delay:
    """Delivers the newest picture that has arrived. One picture per keyframe is taken, `after_s`
    (W,) seconds later. Its delay is the world's `latencies` (W,) keyframes, plus a draw from 0 to
    its `jitters` (W,).
    """

    def __init__(
        self, latencies: Integers, jitters: Integers, keyframe_s: float, after_s: Floats | float = 0
    ):
        worlds = len(latencies)
        self._latencies, self._jitters = latencies, jitters
        self._keyframe_s, self._after_s = float(keyframe_s), np.zeros(worlds) + after_s
        self._draws = DrawnAhead(worlds)
        # No picture is later than latency plus jitter.
        ring = worlds, int((latencies + jitters).max()) + 1
        self._sent = _Sent(
            np.zeros(ring, np.int64),
            np.empty((*ring, 0, len(ImageDetections.COLUMNS))),
            np.empty((*ring, 0), np.int64),
            np.zeros(ring),
            np.zeros(ring, np.int64),
            np.zeros(worlds, np.int64),
            np.zeros(worlds, np.int64),
        )
        self._arrived = Detected.of(worlds, 0)

    def begin(self, world: int, seed: np.random.SeedSequence) -> None:
        """Begin an episode; lateness is drawn from `seed`."""
        self._sent.taken[world] = self._sent.begun[world] = 0
        if self._jitters.any():
            rng, most = np.random.default_rng(seed), self._jitters[world] + 1
            self._draws.begin(world, partial(_below, rng, most))

    def take(self, live: Mask, seen: Detected, headings: Floats) -> None:
        """Take the detections `seen` in a keyframe's pictures of the `live` worlds. `headings` (W,)
        are the cars', radians.
        """
        # Every picture draws its delay, whatever it shows.
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
        _send(live, seen, headings, late, self._sent)

    def newest(self, live: Mask, headings: Floats) -> Detected:
        """Begin a keyframe of the `live` worlds with the cars' `headings` (W,). Return the newest
        detections that are due, with age and yaw change. The next call overwrites them.
        """
        _deliver(live, headings, self._keyframe_s, self._after_s, self._sent, self._arrived)
        return self._arrived


@compiled()
def _send(live: Mask, seen: Detected, headings: Floats, late: Integers, sent: _Sent) -> None:
    """See `Delay.take`."""
    for w in range(len(live)):
        if not live[w]:
            continue
        keyframe = sent.taken[w]
        place = keyframe % sent.due.shape[1]
        sent.taken[w] += 1
        sent.due[w, place] = keyframe + late[w]
        sent.headings[w, place] = headings[w]
        sent.counts[w, place] = seen.counts[w]
        for n in range(seen.counts[w]):
            sent.rows[w, place, n] = seen.rows[w, n]
            sent.objects[w, place, n] = seen.objects[w, n]


@compiled()
def _deliver(
    live: Mask,
    headings: Floats,
    keyframe_s: float,
    after_s: Floats,
    sent: _Sent,
    arrived: Detected,
) -> None:
    """See `Delay.newest`."""
    places = sent.due.shape[1]
    for w in range(len(live)):
        if not live[w]:
            continue
        keyframe = sent.begun[w]
        sent.begun[w] += 1
        arrived.counts[w] = 0
        # The newest first. With jitter a picture can overtake earlier ones, which are then never
        # delivered.
        for age in range(min(keyframe + 1, places)):
            number = keyframe - age
            place = number % places
            if number < sent.taken[w] and sent.due[w, place] <= keyframe:
                arrived.counts[w] = sent.counts[w, place]
                for n in range(sent.counts[w, place]):
                    arrived.rows[w, n] = sent.rows[w, place, n]
                    arrived.objects[w, n] = sent.objects[w, place, n]
                    arrived.rows[w, n, _AGE] += age * keyframe_s - after_s[w]
                    arrived.rows[w, n, _YAW_CHANGE] += headings[w] - sent.headings[w, place]
                break


Draw = Callable[[int], np.ndarray]
"""Gives the rows (k, n) of the next k keyframes of a world, n always the same; for a generator of
NumPy they are those of k calls for one.
"""


class DrawnAhead:
    """Random numbers drawn ahead for so many `keyframes`: a row per world and keyframe, as long as
    the longest that a world needs.
    """

    def __init__(self, worlds: int, keyframes: int = 64):
        self._draws: list[Draw | None] = [None] * worlds
        self._numbers = np.zeros((worlds, keyframes, 0))
        self._used = np.zeros(worlds, np.int64)

    def begin(self, world: int, draw: Draw) -> None:
        """Begin an episode whose numbers `draw` gives."""
        self._draws[world] = draw
        self._used[world] = 0

    def next(self, live: Mask, width: int) -> Floats:
        """Return (W, width) the next keyframe's numbers of the `live` worlds, padded with 1.0."""
        missing = width - self._numbers.shape[2]
        if missing > 0:
            room = (0, 0), (0, 0), (0, missing)
            self._numbers = np.pad(self._numbers, room, constant_values=1.0)
        place = self._used % self._numbers.shape[1]
        for world in np.flatnonzero(live & (place == 0)).tolist():
            self._fill(world)
        self._used += live
        return self._numbers[np.arange(len(live)), place, :width]

    def _fill(self, world: int) -> None:
        draw = self._draws[world]
        if draw is not None:
            rows = draw(self._numbers.shape[1])
            self._numbers[world] = 1.0
            self._numbers[world, :, : rows.shape[1]] = rows
