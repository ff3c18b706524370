"""Detection distances of actors that were never detected: censored, no zeros, and not dropped.

All that is known of such a distance is that it lies between 0 and that of the nearest scan that
passed the actor by. In medians and quartiles it ranks below every detection, and nothing is
interpolated with it.

In a paired difference it enters at the upper end of its range, the reading that favours the policy
that missed. The difference is then a bound on the true one, and says so. It is claimed only when it
holds wherever in its range each censored distance lies. An example with one episode: ours detects
at 15 m, theirs never, and the nearest scan of theirs passed at 4 m. Theirs lies between 0 and 4 m,
so the true difference between 11 and 15 m. It is printed as "≥ 11 m". The cautious reading asks for
the range's end that speaks most against us: theirs at 4 m, 11 m again, which is above 0. Had ours
missed instead, at 4 m, against 15 m of theirs, the difference would lie between -15 and -11 m:
"≤ -11 m".
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from care_sim.evaluation.bootstrap import Interval, paired_difference

FEWEST_PAIRS = 5
"""Fewer pairs carry no claim: by chance alone, one set of four pairs in eight has differences of
one sign (2 / 2^4), and then every resample has that sign.
"""


class Reading(NamedTuple):
    """A value measured in an episode; of a `censored` one is known that the truth lies between 0
    and this.
    """

    value: float
    censored: bool = False


@dataclass(frozen=True)
class Quartiles:
    """Lower quartile, median and upper quartile, None for not detected; the number of values."""

    low: float | None
    median: float | None
    high: float | None
    count: int


class Bound(StrEnum):
    """How a printed difference bounds the true one; the value is the sign to print before it."""

    EXACT = ""
    AT_MOST = "≤"
    AT_LEAST = "≥"
    OPEN = "~"


@dataclass(frozen=True)
class Difference:
    """A mean paired difference with its interval; the true one lies as `bound` says.

    `cautious` is the same with every censored value at the end of its range that speaks most
    against the difference.
    """

    interval: Interval
    bound: Bound
    pairs: int
    cautious: Interval

    @property
    def excludes_zero(self) -> bool:
        """Whether the interval excludes zero, whatever the censored values were; never of fewer
        than 5 pairs.
        """
        # On the side of the mean alone: where the cautious reading turns its sign, nothing is said.
        away = self.cautious.low > 0 if self.interval.mean > 0 else self.cautious.high < 0
        return away and self.pairs >= FEWEST_PAIRS


def quartiles(readings: Sequence[Reading]) -> Quartiles | None:
    """Quartiles, linearly interpolated between detections only; None without readings."""
    if not readings:
        return None
    censored = sum(reading.censored for reading in readings)
    ranked = [-1.0] * censored + sorted(
        reading.value for reading in readings if not reading.censored
    )
    # Any number below 0 ranks below every distance. A quartile whose lower neighbour is censored is
    # not known: the value that is interpolated with that number is dropped.
    shares = (0.25, 0.5, 0.75)
    values = np.quantile(ranked, shares).tolist()
    low, median, high = (
        None if int(share * (len(ranked) - 1)) < censored else value
        for share, value in zip(shares, values, strict=True)
    )
    return Quartiles(low, median, high, len(ranked))


def difference(ours: Sequence[Reading], theirs: Sequence[Reading]) -> Difference:
    """Mean of `ours - theirs`, entry by entry. Raises InvalidInput as `paired_difference` does."""
    interval = paired_difference(_most(ours), _most(theirs))
    # What speaks most against a difference: ours as small as may be where ours seems larger.
    against = (_least(ours), _most(theirs)) if interval.mean > 0 else (_most(ours), _least(theirs))
    cautious = paired_difference(*against)
    return Difference(interval, _bound(ours, theirs), len(ours), cautious)


def _bound(ours: Sequence[Reading], theirs: Sequence[Reading]) -> Bound:
    """How the mean of `ours - theirs`, each censored value at its most, bounds the true mean."""
    # The true value of a censored one is at most that. Where only ours has some, the true
    # difference is smaller or equal; where only theirs has some, larger or equal; where both have
    # some, either.
    ours_missed = any(reading.censored for reading in ours)
    theirs_missed = any(reading.censored for reading in theirs)
    if ours_missed and theirs_missed:
        return Bound.OPEN
    if ours_missed:
        return Bound.AT_MOST
    return Bound.AT_LEAST if theirs_missed else Bound.EXACT


def _most(readings: Sequence[Reading]) -> list[float]:
    return [reading.value for reading in readings]


def _least(readings: Sequence[Reading]) -> list[float]:
    return [0.0 if reading.censored else reading.value for reading in readings]
