"""How much more of a measure one cell has than another, and how sure that is."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from care_sim.evaluation.bootstrap import Interval
from care_sim.evaluation.censoring import Bound, Difference, Reading, difference
from care_sim.evaluation.scene_contrasts import scene_contrast
from care_sim.reports.engine.measures import Measure, Recall, Units
from care_sim.study.run_config import Row

OVER_EVENTS = "°"
"""Stands behind a difference whose interval comes from events."""


@dataclass(frozen=True)
class Contrast:
    """One cell minus another on the units that both have, in the unit of the measure.

    The interval comes from resampling pairs of seeds or scenes, or `over_events` from resampling
    the events of the scenes.
    """

    measure: Measure | Recall
    difference: Difference
    over_events: bool = False

    @property
    def mean(self) -> float:
        """In the unit of the measure."""
        return self.difference.interval.mean

    @property
    def interval(self) -> Interval | None:
        """The interval of the mean; None of too few pairs."""
        enough = self.difference.pairs >= self.measure.fewest_pairs
        return self.difference.interval if enough else None

    @property
    def decimals(self) -> int:
        """Decimals of the measure."""
        return self.measure.decimals

    @property
    def bound(self) -> str:
        """On which side of the mean the true difference may lie; tables print it before."""
        return self.difference.bound

    @property
    def asterisk(self) -> str:
        """An asterisk where the difference counts."""
        return "*" if self.counts else ""

    @property
    def suffix(self) -> str:
        """The mark of an interval over events."""
        return OVER_EVENTS if self.over_events else ""

    @property
    def excludes_zero(self) -> bool:
        """Whether the interval excludes zero, whatever the censored values were."""
        return self.difference.excludes_zero

    @property
    def sign(self) -> int:
        """1 or -1 where the interval excludes zero, else 0."""
        return self.excludes_zero * (1 if self.mean > 0 else -1)

    @property
    def counts(self) -> bool:
        """Whether the difference reaches the gate of the measure."""
        return self.reaches(self.measure.gate)

    def reaches(self, gate: float) -> bool:
        """Whether the interval excludes zero and the mean difference reaches a gate, whatever the
        censored values were.
        """
        # The cautious mean puts every censored distance where it speaks most against the
        # difference.
        return self.excludes_zero and abs(self.difference.cautious.mean) >= gate


def of_interval(
    measure: Measure | Recall, interval: Interval, pairs: int, over_events: bool = False
) -> Contrast:
    """A contrast of a measure without censored values."""
    return Contrast(measure, Difference(interval, Bound.EXACT, pairs, interval), over_events)


def contrast(
    measure: Measure | Recall, ours: Units, theirs: Units, by_cases: bool = False
) -> Contrast | None:
    """`ours` minus `theirs`, paired by unit; None without shared units that hold anything.

    With `by_cases` units are pairs of case and seed, and cases are what is drawn: each counts with
    its means over seeds. One case on many seeds is one world, and no proof.
    """
    if isinstance(measure, Recall):
        found = scene_contrast(measure.ratio, ours, theirs)
        if found is None:
            return None
        interval = found.by_scene if measure.equal_scenes else found.by_event
        return of_interval(measure, interval, found.scenes)
    # Sorted, shared units give the same resamples whatever the order of the rows.
    shared = sorted({*ours} & {*theirs})
    pairs = [(ours[unit], theirs[unit]) for unit in shared]
    if by_cases:
        cases: dict[Any, list[tuple[Reading, Reading]]] = {}
        for (case, _), pair in zip(shared, pairs, strict=True):
            cases.setdefault(case, []).append(pair)
        sides = (zip(*own, strict=True) for own in cases.values())
        pairs = [(_mean(first), _mean(second)) for first, second in sides]
    return Contrast(measure, difference(*zip(*pairs, strict=True))) if pairs else None


def contrast_of_rows(
    measure: Measure, ours: Sequence[Row], theirs: Sequence[Row], by_cases: bool = False
) -> Contrast | None:
    """The same of rows, by seed."""
    return contrast(measure, measure.units(ours), measure.units(theirs), by_cases)


def _mean(readings: Sequence[Reading]) -> Reading:
    """Return the reading of a mean with a censored value: the truth lies between 0 and this."""
    value = float(np.mean([reading.value for reading in readings]))
    return Reading(value, any(reading.censored for reading in readings))
