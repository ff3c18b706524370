"""Detection distances of actors that were never detected: censored values, neither zeros nor
dropped.

Such a distance is only known to lie between 0 and the distance of the nearest scan of the actor. In
medians and quartiles it ranks below every detection, and nothing is interpolated with it.

In a paired difference it enters at the upper end of its range, which favours the policy that
missed. The difference is then a bound on the true one, and is printed as a bound. It is claimed
only if it holds for all values in the range of each censored distance. An example with one episode:
ours detects at 15 m, theirs never, and their nearest scan was at 4 m. Theirs lies between 0 and 4
m, so the true difference lies between 11 and 15 m. It is printed as "≥ 11 m". The cautious reading
takes the end of the range that speaks most against us: theirs at 4 m, again 11 m, which is above 0.
If ours missed at 4 m and theirs detected at 15 m, the difference would lie between -15 and -11 m:
"≤ -11 m".
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from care_sim.evaluation.bootstrap import Interval, paired_difference

FEWEST_PAIRS = 5
"""Fewest pairs of a claim. By chance alone, one set of four pairs in eight has differences of one
sign (2 / 2^4), and then every resample has that sign.
"""


class Reading(NamedTuple):
    """A value measured in an episode. The truth of a `censored` value lies between 0 and the
    value.
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
    """The sign before a printed difference that bounds the true one."""

    EXACT = ""
    AT_MOST = "≤"
    AT_LEAST = "≥"
    OPEN = "~"


@dataclass(frozen=True)
class Difference:
    """A mean paired difference with its interval; `bound` relates it to the true one.

    `cautious` is the same difference with every censored value at the end of its range that speaks
    most against it.
    """

    interval: Interval
    bound: Bound
    pairs: int
    cautious: Interval

    @property
    def excludes_zero(self) -> bool:
        """Return True if the interval excludes zero for all possible censored values; False for
        fewer than 5 pairs.
        """
        # Only on the side of the mean: a cautious reading of opposite sign is no result.
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
    # A number below 0 ranks below every distance. A quartile whose lower neighbour is censored is
    # unknown, so its interpolated value is dropped.
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
    # The cautious reading makes ours as small as possible where ours seems larger.
    against = (_least(ours), _most(theirs)) if interval.mean > 0 else (_most(ours), _least(theirs))
    cautious = paired_difference(*against)
    return Difference(interval, _bound(ours, theirs), len(ours), cautious)


def _bound(ours: Sequence[Reading], theirs: Sequence[Reading]) -> Bound:
    """Return how the mean of `ours - theirs`, with each censored value at its maximum, bounds the
    true mean.
    """
    # The true value is at most the censored one. If only ours has censored values, the true
    # difference is smaller or equal. If only theirs has some, it is larger or equal. If both have
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
