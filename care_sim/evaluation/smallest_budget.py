"""B90: the smallest budget at which a policy reaches 90% of a full scan, on every count.

An entry plays the same worlds at each of `BUDGETS`. The share of a count is its sum over the
worlds, divided by the full scan's sum: every object has the same weight. A share of 90% is enough.
A policy may stop without need in up to 5 in 100 worlds more than the full scan. Between two budgets
shares are linear in the logarithm of the budget.

More cells should never be worse. A curve that falls below 90% again is unreliable above its first
crossing, so the **last** crossing counts. From B90 on every count stays at 90% or above, at every
budget played. B90 is `BUDGETS[0]` if that holds from the smallest budget on ("at most"), and
infinite if it fails at the largest one ("never").

Intervals are over worlds: the worlds of each part are drawn with replacement 10,000 times. All
entries of the same worlds use the same draws, so that a ratio of two entries is paired. Draws of a
part with fewer than `LEAST_WORLDS` are unreliable: tables then print no interval (`has_interval`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats
from care_sim.evaluation.bootstrap import INTERVAL_CONFIDENCE, RESAMPLES
from care_sim.evaluation.counts import NEEDLESS

BUDGETS = (0.005, 0.01, 0.02, 0.03, 0.05, 0.10, 0.20)
"""Shares of all cells, ascending."""
ENOUGH = 0.90
"""Share of a full scan's count that is enough."""
MORE_STOPS = 0.05
"""Needless stops per world that an entry may have more than the full scan."""
LEAST_WORLDS = 5
"""Worlds of a part from which on an interval is printed."""
_ROUNDING = 1e-9
"""Allowance for rounding of a share of exactly 90%."""


@dataclass(frozen=True)
class PartCounts:
    """Counts (k) of one part's worlds (w): an entry's at every budget, `got` (w, b, k), and the
    full scan's, `full` (w, k).

    Raises InvalidInput for shapes that do not fit, for no world, and for numbers that are not
    finite or below 0.
    """

    names: tuple[str, ...]
    got: Floats
    full: Floats

    def __post_init__(self) -> None:
        shape = len(self.full), len(BUDGETS), len(self.names)
        if self.got.shape != shape or self.full.shape != (shape[0], shape[2]) or not shape[0]:
            raise InvalidInput(
                f"counts must be (worlds, {len(BUDGETS)}, {len(self.names)}) of an entry and "
                f"(worlds, {len(self.names)}) of the full scan, got {self.got.shape} and "
                f"{self.full.shape}"
            )
        for numbers in (self.got, self.full):
            if not (np.isfinite(numbers) & (numbers >= 0)).all():
                raise InvalidInput("counts must be finite numbers of 0 or more")


Counts = Sequence[PartCounts]
"""All parts of an entry."""


class SmallestBudget(NamedTuple):
    """B90 with its interval, as shares of all cells."""

    budget: float
    low: float
    high: float


def names_of(counts: Counts) -> tuple[str, ...]:
    """Return the names of all counts, in the order of the arrays of this module."""
    return tuple(name for part in counts for name in part.names)


def has_interval(counts: Counts) -> bool:
    """Return True if every part has enough worlds for an interval."""
    return all(len(part.full) >= LEAST_WORLDS for part in counts)


def shares(counts: Counts) -> Floats:
    """Return each count (b, k) as a share of the full scan's; a share of nothing is NaN. Needless
    stops are the full scan's minus the entry's, per world.
    """
    once = [np.ones((1, len(part.full))) for part in counts]
    levels: Floats = _levels(counts, once)[0]
    return levels


def reaching(counts: Counts) -> Floats:
    """Return the smallest budget (k,) of every count alone."""
    once = [np.ones((1, len(part.full))) for part in counts]
    budgets: Floats = _crossings(_margins(counts, once))[0]
    return budgets


def smallest_budget(counts: Counts, draws: Floats | None = None) -> SmallestBudget:
    """Return B90 of an entry; `draws` are its `resampled_budgets`, if known. A count that is 0 for
    the full scan needs no cell.
    """
    low, high = _interval(resampled_budgets(counts) if draws is None else draws)
    return SmallestBudget(float(reaching(counts).max()), low, high)


def budget_ratio(ours: Counts, theirs: Counts) -> tuple[float, float, float]:
    """Return the paired ratio of two entries' B90 in the same worlds, with its interval.

    If both never reach 90% they tie, with a ratio of 1. Smaller budgets count as `BUDGETS[0]`.
    Shares use the entry's own full scan, since another machine may round its last bit differently.
    Raises InvalidInput for other parts or numbers of worlds.
    """
    sizes = [[(part.names, len(part.full)) for part in counts] for counts in (ours, theirs)]
    if sizes[0] != sizes[1]:
        raise InvalidInput("a ratio of smallest budgets must be of the same worlds")
    ratio = _divided(reaching(ours).max(keepdims=True), reaching(theirs).max(keepdims=True))
    return float(ratio[0]), *ratio_interval(resampled_budgets(ours), resampled_budgets(theirs))


def ratio_interval(ours: Floats, theirs: Floats) -> tuple[float, float]:
    """Return the interval of the ratio of two `resampled_budgets` of the same worlds."""
    return _interval(_divided(ours, theirs))


def _divided(ours: Floats, theirs: Floats) -> Floats:
    both_never = np.isinf(ours) & np.isinf(theirs)
    tied = np.ones_like(ours)
    return np.divide(ours, theirs, out=tied, where=~both_never)


def _interval(values: Floats) -> tuple[float, float]:
    ends = (1 - INTERVAL_CONFIDENCE) / 2, (1 + INTERVAL_CONFIDENCE) / 2
    # Infinite budgets rule out interpolation between two draws.
    low, high = np.quantile(values, ends, method="inverted_cdf")
    return float(low), float(high)


def resampled_budgets(counts: Counts) -> Floats:
    """Return B90 (resamples,) of every draw of worlds."""
    weights = [_drawn(part, len(each.full)) for part, each in enumerate(counts)]
    budgets: Floats = _crossings(_margins(counts, weights)).max(axis=-1)
    return budgets


@lru_cache(maxsize=8)
def _drawn(part: int, worlds: int) -> Floats:
    """Return how often each world of a part is drawn, (resamples, worlds)."""
    rng = np.random.default_rng([0, part])
    return rng.multinomial(worlds, np.full(worlds, 1 / worlds), RESAMPLES).astype(float)


def _margins(counts: Counts, weights: Sequence[Floats]) -> Floats:
    """Return by how much (r, b, k) each count exceeds what is enough."""
    levels = _levels(counts, weights)
    is_stop = np.array([name == NEEDLESS for name in names_of(counts)])
    margins = np.where(is_stop, levels + MORE_STOPS, levels - ENOUGH) + _ROUNDING
    return np.nan_to_num(margins, nan=1.0, posinf=np.inf)


def _levels(counts: Counts, weights: Sequence[Floats]) -> Floats:
    """Return `shares` (r, b, k) of the worlds of every part, with weights (r, w) of the worlds."""
    levels = []
    for part, drawn in zip(counts, weights, strict=True):
        got = np.tensordot(drawn, part.got, axes=1)
        full = (drawn @ part.full)[:, None, :]
        share = np.divide(got, full, out=np.full_like(got, np.nan), where=full > 0)
        less = (full - got) / len(part.full)
        levels.append(np.where(np.array(part.names) == NEEDLESS, less, share))
    return np.concatenate(levels, axis=-1)


def _crossings(margins: Floats) -> Floats:
    """Return the budget (r, k) above which each of the `margins` (r, b, k) stays at 0 or more."""
    missed = margins < 0
    largest = len(BUDGETS) - 1
    # The last budget that misses; -1 where none does.
    last = np.where(missed.any(axis=1), largest - missed[:, ::-1].argmax(axis=1), -1)
    under, above = np.maximum(last, 0), np.minimum(last + 1, largest)
    low, high = (
        np.take_along_axis(margins, place[:, None], axis=1)[:, 0] for place in (under, above)
    )
    logs = np.log(BUDGETS)
    rise = np.where((last >= 0) & (last < largest), high - low, 1.0)
    crossing = np.exp(logs[under] - low / rise * (logs[above] - logs[under]))
    return np.where(last < 0, BUDGETS[0], np.where(last == largest, np.inf, crossing))
