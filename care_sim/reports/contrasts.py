"""What is compared between policies, and from which size on a difference counts.

Policies are compared seed by seed, because a seed fixes world, faults and floor (common random
numbers).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter
from typing import Any

import numpy as np

from care_sim.evaluation.bootstrap import Interval
from care_sim.evaluation.censoring import Difference, Reading, difference
from care_sim.study.rows.reading import detection, is_avoided
from care_sim.study.run_config import Row

GATE_M = 2.5
"""What the ego covers at 30 km/h (8.33 m/s) while the controller's brake builds up (0.3 s); an
earlier detection by less buys less than the reaction.
"""
GATE_POINTS = 5.0
"""The gate of the paper (Sec. 5.2), fixed there before the runs."""
GATE_COLLISION_POINTS = 10.0
"""Of the collisions that a full scan prevents; stated before a world was validated."""


@dataclass(frozen=True)
class Measure:
    """A quantity of an episode, its unit and decimals, and the `gate`: the smallest mean difference
    that counts.
    """

    name: str
    unit: str
    decimals: int
    gate: float
    read: Callable[[Row], Reading | None]
    """None of an episode that has no such quantity."""


def _detected(row: Row) -> Reading | None:
    found = detection(row)
    return None if found is None else Reading(100.0 * (not found.censored))


DETECTION = Measure("First detection", "m", 1, GATE_M, detection)
BRAKED = Measure("Braked", "points", 0, GATE_POINTS, lambda row: Reading(100.0 * row["braked"]))
DETECTED = Measure("Detected", "points", 0, GATE_POINTS, _detected)
AVOIDED = Measure(
    "Collisions avoided",
    "points",
    0,
    GATE_COLLISION_POINTS,
    lambda row: Reading(100.0 * is_avoided(row)),
)


@dataclass(frozen=True)
class Contrast:
    """How much more of a measure one policy has than another on the same seeds."""

    measure: Measure
    difference: Difference

    @property
    def mean(self) -> float:
        """In the unit of the measure."""
        return self.difference.interval.mean

    @property
    def interval(self) -> Interval | None:
        """The interval of the mean; None of a single pair, which tells of no spread."""
        return self.difference.interval if self.difference.pairs > 1 else None

    @property
    def decimals(self) -> int:
        """Decimals of the measure."""
        return self.measure.decimals

    @property
    def bound(self) -> str:
        """On which side of the mean the true difference may lie."""
        return self.difference.bound

    @property
    def asterisk(self) -> str:
        """An asterisk where the difference counts."""
        return "*" if self.counts else ""

    @property
    def suffix(self) -> str:
        """Empty: the intervals of the closed loop all rest on seeds."""
        return ""

    @property
    def excludes_zero(self) -> bool:
        """Whether the interval excludes zero."""
        return self.difference.excludes_zero

    @property
    def counts(self) -> bool:
        """Whether the interval excludes zero and the mean difference reaches the gate, whatever the
        censored were.
        """
        # The cautious mean puts every censored distance where it speaks most against the
        # difference.
        return self.excludes_zero and abs(self.difference.cautious.mean) >= self.measure.gate


def contrast(
    measure: Measure, ours: Sequence[Row] | None, theirs: Sequence[Row] | None
) -> Contrast | None:
    """`ours` minus `theirs`, paired by seed; None without shared seeds that have the measure."""
    pairs = _pairs(measure, ours, theirs)
    if not pairs:
        return None
    a, b = zip(*pairs.values(), strict=True)
    return Contrast(measure, difference(a, b))


def contrast_of_cases(
    measure: Measure, ours: Sequence[Row] | None, theirs: Sequence[Row] | None
) -> Contrast | None:
    """The same of rows whose `seed` is a pair of case and seed, where cases are what is drawn: each
    counts with its means over the seeds. One case on many seeds is so one world, and no proof.
    """
    pairs = _pairs(measure, ours, theirs)
    if not pairs:
        return None
    means = []
    for _, worlds in groupby(pairs, key=itemgetter(0)):
        a, b = zip(*(pairs[world] for world in worlds), strict=True)
        means.append((_mean(a), _mean(b)))
    a, b = zip(*means, strict=True)
    return Contrast(measure, difference(a, b))


def preventable(full: Sequence[Row], rows: Sequence[Row]) -> list[Row]:
    """The rows of the seeds on which the full scan avoids the collision."""
    spared = {row["seed"] for row in full if is_avoided(row)}
    return [row for row in rows if row["seed"] in spared]


def _pairs(
    measure: Measure, ours: Sequence[Row] | None, theirs: Sequence[Row] | None
) -> dict[Any, tuple[Reading, Reading]]:
    """What both have measured, by seed."""
    a, b = (_read(measure, rows or ()) for rows in (ours, theirs))
    # Only seeds that both have played are pairs. Sorted, they give the same resamples whatever the
    # order of the rows.
    return {seed: (a[seed], b[seed]) for seed in sorted(set(a) & set(b))}


def _mean(readings: Sequence[Reading]) -> Reading:
    """Of a mean with a censored value is known that the truth lies between 0 and this."""
    value = float(np.mean([reading.value for reading in readings]))
    return Reading(value, any(reading.censored for reading in readings))


def _read(measure: Measure, rows: Sequence[Row]) -> dict[Any, Reading]:
    """What was measured, by seed."""
    found = ((row["seed"], measure.read(row)) for row in rows)
    return {seed: reading for seed, reading in found if reading is not None}
