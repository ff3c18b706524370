"""Paired bootstrap: how sure a difference is between two policies that met the same episodes."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from care_sim.errors import InvalidInput

RESAMPLES = 10_000
"""Paired resamples (paper, Remark 1)."""
CONFIDENCE = 0.95

Floats = NDArray[np.float64]


class Interval(NamedTuple):
    """A mean difference and the ends of its confidence interval, in the unit of the samples."""

    mean: float
    low: float
    high: float


def paired_difference(
    ours: ArrayLike, theirs: ArrayLike, *, confidence: float = CONFIDENCE, resamples: int = RESAMPLES, seed: int = 0
) -> Interval:
    """Mean of `ours - theirs` with a percentile bootstrap interval (Efron and Tibshirani 1994).

    Both are (n,) and paired: entry i of each comes from the same episode. The resampling is seeded.
    Differences that are all equal have that value for both ends. Raises InvalidInput for samples that
    are empty, of unequal length, or not finite.
    """
    a, b = np.atleast_1d(np.asarray(ours, float)), np.atleast_1d(np.asarray(theirs, float))
    differences = _differences(a, b)
    if np.ptp(differences) <= 1e-12 * max(1.0, float(np.abs(a).max())):
        mean = float(differences.mean())
        return Interval(mean, mean, mean)
    return _resampled(tuple(differences.tolist()), confidence, resamples, seed)


@lru_cache(maxsize=10_000)
def _resampled(differences: tuple[float, ...], confidence: float, resamples: int, seed: int) -> Interval:
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


def _differences(ours: Floats, theirs: Floats) -> Floats:
    if ours.ndim != 1 or ours.shape != theirs.shape or not ours.size:
        raise InvalidInput(
            f"paired samples must be two lists of one length, at least one long; got {ours.shape} and {theirs.shape}"
        )
    if not np.all(np.isfinite(ours) & np.isfinite(theirs)):
        raise InvalidInput("paired samples must be finite")
    return ours - theirs
