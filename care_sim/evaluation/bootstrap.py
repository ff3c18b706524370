"""Paired bootstrap: intervals of differences between two policies in the same episodes.

Episodes differ from each other, which hides differences between policies. The difference of a pair
cancels what both policies share in an episode. So pairs are resampled, never each policy by itself.

`paired_difference` computes the closed loop's intervals over episodes, through
`care_sim.evaluation.censoring`. `ratio_of_sums` computes the main intervals of the open loop, over
scenes, with equal weight per event (`care_sim.evaluation.scene_contrasts`). There
`paired_difference` computes intervals with equal weight per scene, and intervals over events.

All intervals are percentile intervals (Efron and Tibshirani 1994), seeded, and cached, since tables
and pages share them.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers

RESAMPLES = 10_000
"""Paired resamples (paper, Remark 1)."""
INTERVAL_CONFIDENCE = 0.95
_ENDS = ((1 - INTERVAL_CONFIDENCE) / 2, 1 - (1 - INTERVAL_CONFIDENCE) / 2)

Sums = tuple[ArrayLike, ArrayLike]
"""Numerators and denominators (n,) of a group of scenes, scene by scene."""
_Group = tuple[tuple[float, ...], tuple[float, ...]]
"""The same as tuples, as keys of the cache."""


class Interval(NamedTuple):
    """A mean difference and the ends of its confidence interval, in the unit of the samples."""

    mean: float
    low: float
    high: float


def paired_difference(ours: ArrayLike, theirs: ArrayLike) -> Interval:
    """Return the mean of `ours - theirs` with its interval.

    Both are (n,) and paired: entry i of each comes from the same episode. Differences that are all
    equal have that value for both ends. Raises InvalidInput for samples that are empty, of unequal
    length, or not finite.
    """
    a, b = _pairs(ours, theirs)
    differences = a - b
    # Equal differences have equal resamples, so nothing is drawn. Subtraction errs in the last bits
    # of the samples, so the tolerance follows their size.
    if _are_equal(differences, like=a):
        mean = float(differences.mean())
        return Interval(mean, mean, mean)
    return _resampled_mean(tuple(differences.tolist()))


def ratio_of_sums(group: Sums, *, less: Sums | None = None) -> Interval:
    """Return the ratio of the sums of a group of scenes with its interval; scenes are drawn with
    replacement.

    With `ours - theirs` as numerators and events as denominators, the ratio is the difference of
    two policies with equal weight per event, paired by scene. With a second group, `less`, its
    ratio is subtracted; scenes are then drawn within each group.

    Groups whose scenes all have one ratio return the value for both ends. A denominator may be 0
    where another of its group is not. Resamples that sum to 0 have no ratio and are ignored. Raises
    InvalidInput for sums that are empty, of unequal length or not finite, and for denominators that
    are negative or all 0.
    """
    # A ratio of sums, not a mean of ratios: every event weighs alike, whether its scene has many or
    # few. A scene is drawn as a whole, with its numerator and its denominator, since what happens
    # within one is not independent.
    second = () if less is None else (_group(*less),)
    return _resampled_ratios((_group(*group), *second))


@lru_cache(maxsize=10_000)
def _resampled_ratios(groups: tuple[_Group, ...]) -> Interval:
    """Return the first group's ratio minus those of the others, with its interval."""
    sums = [(np.array(numerators), np.array(denominators)) for numerators, denominators in groups]

    def combined(ratios: Sequence[Floats]) -> Floats:
        return ratios[0] - sum(ratios[1:])

    value = float(combined([a.sum() / b.sum() for a, b in sums]))
    # Where all scenes of a group have one ratio, every resample of it has that ratio, too.
    if all(_have_one_ratio(a, b) for a, b in sums):
        return Interval(value, value, value)
    # Rows are drawn, and both columns of the drawn scenes follow from them. SciPy's bootstrap draws
    # the same, but knows no interval where a single resample has no ratio.
    rng = np.random.default_rng(0)
    drawn = [rng.integers(0, len(a), (RESAMPLES, len(a))) for a, _ in sums]
    ratios = []
    for (a, b), rows in zip(sums, drawn, strict=True):
        totals = b[rows].sum(axis=-1)
        nothing = np.full(RESAMPLES, np.nan)
        ratios.append(np.divide(a[rows].sum(axis=-1), totals, out=nothing, where=totals > 0))
    low, high = np.nanquantile(combined(ratios), _ENDS)
    return Interval(value, float(low), float(high))


@lru_cache(maxsize=10_000)
def _resampled_mean(differences: tuple[float, ...]) -> Interval:
    # The percentile interval is that of the mean's own distribution over resamples: it needs no
    # symmetry, and never leaves the range of the samples.
    values = np.array(differences)
    drawn = _drawn(len(values))
    # A hundred resamples at a time stay in the processor's cache, which halves the time.
    parts = [values.take(drawn[n : n + 100]).mean(axis=-1) for n in range(0, RESAMPLES, 100)]
    low, high = np.quantile(np.concatenate(parts), _ENDS)
    return Interval(float(values.mean()), float(low), float(high))


@lru_cache(maxsize=1)
def _drawn(count: int) -> Integers:
    """Return (resamples, count) drawn rows. Cached, since most tables compare policies on equally
    many episodes. The draws equal those of `scipy.stats.bootstrap`, which takes three times as
    long.
    """
    return np.random.default_rng(0).integers(0, count, (RESAMPLES, count))


def _have_one_ratio(numerators: Floats, denominators: Floats) -> bool:
    """Return True if every scene has the ratio of the sums, or zeros."""
    expected = numerators.sum() / denominators.sum() * denominators
    return _are_equal(numerators - expected, like=numerators)


def _are_equal(values: Floats, like: Floats) -> bool:
    """Return True if all values are equal up to the last bits of numbers as large as `like`."""
    return bool(np.ptp(values) <= 1e-12 * max(1.0, float(np.abs(like).max())))


def _group(numerators: ArrayLike, denominators: ArrayLike) -> _Group:
    a, b = _pairs(numerators, denominators)
    if np.any(b < 0) or not b.any():
        raise InvalidInput("the denominators of a ratio must be 0 or more, and one above 0")
    return tuple(a.tolist()), tuple(b.tolist())


def _pairs(ours: ArrayLike, theirs: ArrayLike) -> tuple[Floats, Floats]:
    """Both as arrays. Raises InvalidInput unless they are finite pairs."""
    a, b = (np.atleast_1d(np.asarray(samples, float)) for samples in (ours, theirs))
    if a.ndim != 1 or a.shape != b.shape or not a.size:
        raise InvalidInput(
            "paired samples must be two lists of one length, at least one long; "
            f"got {a.shape} and {b.shape}"
        )
    if not np.all(np.isfinite(a) & np.isfinite(b)):
        raise InvalidInput("paired samples must be finite")
    return a, b
