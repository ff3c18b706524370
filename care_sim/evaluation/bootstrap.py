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
from scipy import stats

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers

RESAMPLES = 10_000
"""Paired resamples (paper, Remark 1)."""
INTERVAL_CONFIDENCE = 0.95

Sums = tuple[ArrayLike, ArrayLike]
"""Numerators and denominators (n,) of a group of scenes, scene by scene."""


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
    ratio give the value for both ends. Raises InvalidInput for sums that are empty, of unequal
    length or not finite, for a denominator that is not positive, and for one scene beside a second
    group.
    """
    # A ratio of sums, not a mean of ratios: every event weighs alike, whether its scene has many or
    # few. A scene is drawn as a whole, with its numerator and its denominator, since what happens
    # within one is not independent.
    groups = [_sums(*sums) for sums in ([group] if less is None else [group, less])]
    value = _difference_of_ratios(groups, [np.arange(len(numerators)) for numerators, _ in groups])

    # Where all scenes of a group have one ratio, every resample of it has that ratio, too.
    ratios = [numerators / denominators for numerators, denominators in groups]
    if all(_are_equal(each, like=each) for each in ratios):
        return Interval(float(value), float(value), float(value))
    if any(len(numerators) < 2 for numerators, _ in groups):
        raise InvalidInput("a group of scenes to be drawn from must have at least two")

    # SciPy draws rows, and both columns of the drawn scenes follow from them.
    result = stats.bootstrap(
        [np.arange(len(numerators)) for numerators, _ in groups],
        lambda *drawn, axis=-1: _difference_of_ratios(groups, drawn, axis),
        n_resamples=resamples,
        confidence_level=confidence,
        method="percentile",
        vectorized=True,
        rng=np.random.default_rng(seed),
    )
    low, high = result.confidence_interval
    return Interval(float(value), float(low), float(high))


def _difference_of_ratios(
    groups: Sequence[tuple[Floats, Floats]], drawn: Sequence[Integers], axis: int = -1
) -> Floats:
    """Ratio of the drawn scenes of the first group, less that of the second where there is one."""
    # Scenes lie along `axis`; SciPy draws many resamples at once along the other.
    first, *second = (
        numerators[rows].sum(axis) / denominators[rows].sum(axis)
        for (numerators, denominators), rows in zip(groups, drawn, strict=True)
    )
    return np.asarray(first - sum(second))


def _are_equal(values: Floats, like: Floats) -> bool:
    """Whether all values are one number but for the last bits of numbers as large as `like`."""
    return bool(np.ptp(values) <= 1e-12 * max(1.0, float(np.abs(like).max())))


def _sums(numerators: ArrayLike, denominators: ArrayLike) -> tuple[Floats, Floats]:
    """The two columns of a group as arrays. Raises InvalidInput as `ratio_of_sums` does."""
    a = np.atleast_1d(np.asarray(numerators, float))
    b = np.atleast_1d(np.asarray(denominators, float))
    _check_pairs(a, b)
    if np.any(b <= 0):
        raise InvalidInput(
            "the denominators of a ratio must be positive: leave out scenes without an event"
        )
    return a, b


@lru_cache(maxsize=10_000)
def _resampled(
    differences: tuple[float, ...], confidence: float, resamples: int, seed: int
) -> Interval:
    """The interval of a mean; remembered, since tables and pages ask for the same ones again."""
    # The percentile interval is that of the mean's own distribution over resamples: it needs no
    # symmetry, and never leaves the range of the samples.
    result = stats.bootstrap(
        (np.array(differences),),
        np.mean,
        n_resamples=resamples,
        confidence_level=confidence,
        method="percentile",
        rng=np.random.default_rng(seed),
    )
    low, high = result.confidence_interval
    return Interval(float(np.mean(differences)), float(low), float(high))


def _check_pairs(ours: Floats, theirs: Floats) -> None:
    if ours.ndim != 1 or ours.shape != theirs.shape or not ours.size:
        raise InvalidInput(
            "paired samples must be two lists of one length, at least one long; "
            f"got {ours.shape} and {theirs.shape}"
        )
    if not np.all(np.isfinite(ours) & np.isfinite(theirs)):
        raise InvalidInput("paired samples must be finite")
