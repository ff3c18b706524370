"""Paired bootstrap: how sure a difference is between two policies that met the same episodes.

Episodes differ among each other, and that hides how two policies differ in one of them. What both
share in an episode drops out of the difference of the pair. So pairs are resampled, never each
policy by itself.

`paired_difference` gives the intervals of the closed loop, over episodes, by way of
`care_sim.evaluation.censoring`. `ratio_of_sums` gives the main intervals of the open-loop protocol,
over scenes, in which every event weighs alike (`care_sim.evaluation.scene_contrasts`); beside them
`paired_difference` gives those in which every scene does, and those over events.
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

Sums = tuple[ArrayLike, ArrayLike]
"""Numerators and denominators (n,) of a group of scenes, scene by scene."""


_Hashable = tuple[tuple[tuple[float, ...], tuple[float, ...]], ...]
"""The sums of groups as tuples, by which a result is remembered."""


class Interval(NamedTuple):
    """A mean difference and the ends of its confidence interval, in the unit of the samples."""

    mean: float
    low: float
    high: float


def paired_difference(
    ours: ArrayLike,
    theirs: ArrayLike,
    *,
    confidence: float = INTERVAL_CONFIDENCE,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> Interval:
    """Mean of `ours - theirs` with a percentile bootstrap interval (Efron and Tibshirani 1994).

    Both are (n,) and paired: entry i of each comes from the same episode. The resampling is seeded.
    Differences that are all equal have that value for both ends. Raises InvalidInput for samples
    that are empty, of unequal length, or not finite.
    """
    a = np.atleast_1d(np.asarray(ours, float))
    b = np.atleast_1d(np.asarray(theirs, float))
    _check_pairs(a, b)
    differences = a - b

    # Equal differences have equal resamples, and nothing is to be drawn. Subtraction leaves an
    # error of the last bits of the samples, so it is their size that counts.
    if _are_equal(differences, like=a):
        mean = float(differences.mean())
        return Interval(mean, mean, mean)
    return _resampled(tuple(differences.tolist()), confidence, resamples, seed)


def ratio_of_sums(
    group: Sums,
    *,
    less: Sums | None = None,
    confidence: float = INTERVAL_CONFIDENCE,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> Interval:
    """Ratio of the sums of a group of scenes with a percentile bootstrap interval; scenes are drawn
    with replacement.

    With `ours - theirs` as numerators and the events as denominators it is the difference of two
    policies in which every event weighs alike, paired by scene. With a second group, `less`, its
    ratio is taken off; scenes are then drawn within each group. Groups whose scenes all have one
    ratio give the value for both ends. A denominator may be 0 where another of its group is not;
    resamples that sum to 0 have no ratio and are ignored. Raises InvalidInput for sums that are
    empty, of unequal length or not finite, for denominators that are negative or all 0, and for one
    scene beside a second group.
    """
    # A ratio of sums, not a mean of ratios: every event weighs alike, whether its scene has many or
    # few. A scene is drawn as a whole, with its numerator and its denominator, since what happens
    # within one is not independent.
    groups = [_sums(*sums) for sums in ([group] if less is None else [group, less])]
    return _resampled_ratio(_hashable(groups), confidence, resamples, seed)


def mean_of_ratios(
    groups: Sequence[Sums],
    *,
    confidence: float = INTERVAL_CONFIDENCE,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> Interval:
    """Mean of the ratios of sums of several groups of scenes, all of one weight, with a percentile
    bootstrap interval; scenes are drawn with replacement within each group.

    With differences as numerators it is the mean difference of two policies, paired by scene.
    Raises InvalidInput for no group, and as `ratio_of_sums` does.
    """
    if not groups:
        raise InvalidInput("a mean of ratios must be of at least one group")
    return _resampled_mean_of_ratios(
        _hashable([_sums(*sums) for sums in groups]), confidence, resamples, seed
    )


@lru_cache(maxsize=10_000)
def _resampled_mean_of_ratios(
    columns: _Hashable, confidence: float, resamples: int, seed: int
) -> Interval:
    """The interval of a mean of ratios; remembered: a result is ranked, told and drawn by it."""
    groups = _arrays(columns)
    value = float(np.mean([_ratio(a.sum(), b.sum()) for a, b in groups]))
    if all(_have_one_ratio(*group) for group in groups):
        return Interval(value, value, value)
    rng = np.random.default_rng(seed)
    drawn = [rng.integers(0, len(each), (resamples, len(each))) for each, _ in groups]
    ratios = [
        _ratio(a[rows].sum(axis=-1), b[rows].sum(axis=-1))
        for (a, b), rows in zip(groups, drawn, strict=True)
    ]
    # A resample in which a group has a denominator of 0 has no mean, and is ignored.
    outside = (1 - confidence) / 2
    low, high = np.nanquantile(np.mean(ratios, axis=0), [outside, 1 - outside])
    return Interval(value, float(low), float(high))


@lru_cache(maxsize=10_000)
def _resampled_ratio(
    columns: _Hashable,
    confidence: float,
    resamples: int,
    seed: int,
) -> Interval:
    """The interval of a ratio of sums, or of a difference of two; remembered as that of a mean."""
    groups = _arrays(columns)
    value = float(_difference_of_ratios(groups, [np.arange(len(each)) for each, _ in groups]))

    # Where all scenes of a group have one ratio, every resample of it has that ratio, too.
    if all(_have_one_ratio(*group) for group in groups):
        return Interval(value, value, value)
    if any(len(numerators) < 2 for numerators, _ in groups):
        raise InvalidInput("a group of scenes to be drawn from must have at least two")

    # Rows are drawn, and both columns of the drawn scenes follow from them. SciPy's bootstrap draws
    # the same, but knows no interval where a single resample has no ratio.
    rng = np.random.default_rng(seed)
    drawn = [rng.integers(0, len(each), (resamples, len(each))) for each, _ in groups]
    outside = (1 - confidence) / 2
    low, high = np.nanquantile(_difference_of_ratios(groups, drawn), [outside, 1 - outside])
    return Interval(value, float(low), float(high))


def _difference_of_ratios(
    groups: Sequence[tuple[Floats, Floats]], drawn: Sequence[Integers]
) -> Floats:
    """(...) ratio of the drawn scenes of the first group, less that of the second where there is
    one, from rows (..., n) of each; nan where one of them has a denominator of 0.
    """
    first, *second = (
        _ratio(numerators[rows].sum(axis=-1), denominators[rows].sum(axis=-1))
        for (numerators, denominators), rows in zip(groups, drawn, strict=True)
    )
    return np.asarray(first - sum(second))


def _ratio(numerators: Floats, denominators: Floats) -> Floats:
    nothing = np.full(np.shape(denominators), np.nan)
    np.divide(numerators, denominators, out=nothing, where=np.greater(denominators, 0))
    return nothing


def _have_one_ratio(numerators: Floats, denominators: Floats) -> bool:
    """Whether every scene has the ratio of the sums, or holds nothing of either."""
    expected = numerators.sum() / denominators.sum() * denominators
    return _are_equal(numerators - expected, like=numerators)


def _are_equal(values: Floats, like: Floats) -> bool:
    """Whether all values are one number but for the last bits of numbers as large as `like`."""
    return bool(np.ptp(values) <= 1e-12 * max(1.0, float(np.abs(like).max())))


def _hashable(groups: Sequence[tuple[Floats, Floats]]) -> _Hashable:
    return tuple((tuple(a.tolist()), tuple(b.tolist())) for a, b in groups)


def _arrays(columns: _Hashable) -> list[tuple[Floats, Floats]]:
    return [(np.array(numerators), np.array(denominators)) for numerators, denominators in columns]


def _sums(numerators: ArrayLike, denominators: ArrayLike) -> tuple[Floats, Floats]:
    """The two columns of a group as arrays. Raises InvalidInput as `ratio_of_sums` does."""
    a = np.atleast_1d(np.asarray(numerators, float))
    b = np.atleast_1d(np.asarray(denominators, float))
    _check_pairs(a, b)
    if np.any(b < 0) or not b.any():
        raise InvalidInput("the denominators of a ratio must be 0 or more, and one above 0")
    return a, b


@lru_cache(maxsize=10_000)
def _resampled(
    differences: tuple[float, ...], confidence: float, resamples: int, seed: int
) -> Interval:
    """The interval of a mean; remembered, since tables and pages ask for the same ones again."""
    # The percentile interval is that of the mean's own distribution over resamples: it needs no
    # symmetry, and never leaves the range of the samples.
    values = np.array(differences)
    drawn = _drawn(len(values), resamples, seed)
    # A hundred resamples at a time stay in the processor's cache, which halves the time.
    parts = [values.take(drawn[n : n + 100]).mean(axis=-1) for n in range(0, resamples, 100)]
    outside = (1 - confidence) / 2
    low, high = np.quantile(np.concatenate(parts), [outside, 1 - outside])
    return Interval(float(values.mean()), float(low), float(high))


@lru_cache(maxsize=1)
def _drawn(count: int, resamples: int, seed: int) -> Integers:
    """(resamples, count) rows that are drawn; remembered, since most tables compare policies on as
    many episodes. They are the draws of `scipy.stats.bootstrap`, which takes three times as long.
    """
    return np.random.default_rng(seed).integers(0, count, (resamples, count))


def _check_pairs(ours: Floats, theirs: Floats) -> None:
    if ours.ndim != 1 or ours.shape != theirs.shape or not ours.size:
        raise InvalidInput(
            "paired samples must be two lists of one length, at least one long; "
            f"got {ours.shape} and {theirs.shape}"
        )
    if not np.all(np.isfinite(ours) & np.isfinite(theirs)):
        raise InvalidInput("paired samples must be finite")
