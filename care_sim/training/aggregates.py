"""What several training seeds reach together, and how sure that is: the definitions of Agarwal et
al. 2021, "Deep reinforcement learning at the edge of the statistical precipice".

Scores are (runs, tasks). Runs are of one recipe and differ by their training seed.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats

RESAMPLES = 2_000
"""Drawn for one interval."""
CONFIDENCE = 0.95
_CUT = 0.25
"""Share of the scores that is left out at either end."""


class Aggregate(NamedTuple):
    """A number over all runs, and the ends of its interval, which are None for a single run."""

    value: float
    low: float | None
    high: float | None

    def __str__(self) -> str:
        if self.low is None or self.high is None:
            return f"{self.value:.2f}"
        return f"{self.value:.2f} [{self.low:.2f}, {self.high:.2f}]"


def interquartile_mean(scores: ArrayLike) -> Aggregate:
    """The mean of the middle half of all scores (runs, tasks).

    The interval is that of the stratified bootstrap: in every task the runs are drawn with
    replacement, independently of the other tasks, so that no task is left out of a resample. Raises
    InvalidInput for scores that are empty or not finite.
    """
    table = _table(scores)
    return Aggregate(float(_middle(table.ravel())), *_ends(table, _middle))


def performance_profile(scores: ArrayLike, levels: ArrayLike) -> list[Aggregate]:
    """The share of the scores (runs, episodes) that lie above each of `levels`.

    The interval is that of the bootstrap over whole runs: a run plays all episodes, and what it is
    better or worse at than another shows in all of them. Drawn episode by episode, runs would
    cancel, and the interval would vanish as episodes become more.
    """
    table = _table(scores)
    shares = [
        (table > level).mean(axis=1, keepdims=True)
        for level in np.atleast_1d(np.asarray(levels, float))
    ]
    return [Aggregate(float(each.mean()), *_ends(each, _mean)) for each in shares]


def _middle(scores: Floats) -> Floats:
    result: Floats = np.asarray(stats.trim_mean(scores, _CUT, axis=-1))
    return result


def _mean(scores: Floats) -> Floats:
    result: Floats = np.asarray(scores.mean(axis=-1))
    return result


def _ends(
    table: Floats, statistic: Callable[[Floats], Floats]
) -> tuple[float, float] | tuple[None, None]:
    """Of the interval of a statistic of all scores, which it takes along the last axis."""
    if len(table) < 2:
        return None, None
    interval = stats.bootstrap(
        tuple(table.T),
        lambda *tasks, axis: statistic(
            np.concatenate([np.moveaxis(task, axis, -1) for task in tasks], axis=-1)
        ),
        n_resamples=RESAMPLES,
        confidence_level=CONFIDENCE,
        method="percentile",
        vectorized=True,
        rng=np.random.default_rng(0),
    ).confidence_interval
    return float(interval.low), float(interval.high)


def _table(scores: ArrayLike) -> Floats:
    table: Floats = np.asarray(scores, float)
    if table.ndim != 2 or not table.size or not np.isfinite(table).all():
        raise InvalidInput(f"scores must be finite (runs, tasks), got the shape {table.shape}")
    return table
