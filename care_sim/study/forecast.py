"""How long the rest of a study will take, from what its episodes took so far."""

import math
from collections import Counter
from collections.abc import Iterable

from care_sim.study.config import EpisodeConfig

Likeness = tuple[object, ...]
"""What episodes have in common."""


class Forecast:
    """Predicts the time that the waiting episodes of a run still need.

    An episode is expected to take as long as the mean of those most like it: all equal but the seed, else
    scenario, policy and budget, else the policy, else all. What this run has measured comes before what
    an `earlier` run did, perhaps on another machine: pairs of configuration and seconds.
    """

    def __init__(self, waiting: Iterable[EpisodeConfig], earlier: Iterable[tuple[EpisodeConfig, float]] = ()):
        self._waiting = Counter(map(_likenesses, waiting))
        self._now, self._earlier = _Means(), _Means()
        for config, seconds in earlier:
            self._earlier.add(_likenesses(config), seconds)

    @property
    def waiting(self) -> int:
        """Episodes that have not ended."""
        return self._waiting.total()

    def finished(self, config: EpisodeConfig, seconds: float) -> None:
        """An episode has ended after so many seconds; one that failed counts as 0."""
        self._waiting[_likenesses(config)] -= 1
        self._now.add(_likenesses(config), seconds)

    def remaining_s(self, workers: int) -> float:
        """Seconds until the last episode ends, with so many workers; NaN while nothing is known."""
        expected = {kind: self._expected_s(kind) for kind, number in self._waiting.items() if number > 0}
        if not expected:
            return 0.0
        total = sum(self._waiting[kind] * seconds for kind, seconds in expected.items())
        return max(total / max(workers, 1), max(expected.values()))

    def _expected_s(self, kind: tuple[Likeness, ...]) -> float:
        candidates = (means.get(likeness) for likeness in kind for means in (self._now, self._earlier))
        return next((seconds for seconds in candidates if seconds is not None), math.nan)


class _Means:
    def __init__(self) -> None:
        self._sums: dict[Likeness, tuple[float, int]] = {}

    def add(self, likenesses: tuple[Likeness, ...], seconds: float) -> None:
        for likeness in likenesses:
            total, number = self._sums.get(likeness, (0.0, 0))
            self._sums[likeness] = (total + seconds, number + 1)

    def get(self, likeness: Likeness) -> float | None:
        total, number = self._sums.get(likeness, (0.0, 0))
        return total / number if number else None


def _likenesses(config: EpisodeConfig) -> tuple[Likeness, ...]:
    """What an episode shares with others, the closest likeness first."""
    all_but_seed = tuple(item for item in config.row().items() if item[0] != "seed")
    return all_but_seed, (config.scenario, config.policy, config.budget), (config.policy,), ()
