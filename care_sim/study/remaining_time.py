"""How long the rest of a study will take, judged by what its tasks took so far."""

import math
from collections import Counter
from collections.abc import Iterable

from care_sim.study.run_config import RunConfig, SimilarityKey


class RemainingTime:
    """Predicts the time that the waiting tasks of a run still need.

    A task is expected to take as long as the mean of those most like it
    (`RunConfig.similarity_keys`). What this run has measured comes before what an `earlier` run
    did, perhaps on another machine: pairs of task and seconds.
    """

    def __init__(
        self, waiting: Iterable[RunConfig], earlier: Iterable[tuple[RunConfig, float]] = ()
    ):
        self._waiting = Counter(task.similarity_keys for task in waiting)
        self._now = _Means()
        self._earlier = _Means()
        for task, seconds in earlier:
            self._earlier.add(task.similarity_keys, seconds)

    @property
    def waiting(self) -> int:
        """Tasks that have not ended."""
        return self._waiting.total()

    def finished(self, task: RunConfig, seconds: float | None) -> None:
        """A task has ended after so many seconds; one that failed counts as 0, and None is no
        measure of others.
        """
        self._waiting[task.similarity_keys] -= 1
        if seconds is not None:
            self._now.add(task.similarity_keys, seconds)

    def remaining_s(self, workers: int) -> float:
        """Seconds until the last task ends with so many workers; NaN while nothing is known."""
        expected = {
            kind: self._expected_s(kind) for kind, number in self._waiting.items() if number > 0
        }
        if not expected:
            return 0.0
        total = sum(self._waiting[kind] * seconds for kind, seconds in expected.items())
        # The work shared evenly, but never less than the longest task, which no second worker
        # shortens.
        return max(total / max(workers, 1), max(expected.values()))

    def _expected_s(self, kind: tuple[SimilarityKey, ...]) -> float:
        # The closest key first, and for each what this run has measured before what an earlier
        # one did.
        candidates = (means.get(key) for key in kind for means in (self._now, self._earlier))
        return next((seconds for seconds in candidates if seconds is not None), math.nan)


class _Means:
    def __init__(self) -> None:
        self._sums: dict[SimilarityKey, tuple[float, int]] = {}

    def add(self, similarity_keys: tuple[SimilarityKey, ...], seconds: float) -> None:
        for key in similarity_keys:
            total, number = self._sums.get(key, (0.0, 0))
            self._sums[key] = (total + seconds, number + 1)

    def get(self, key: SimilarityKey) -> float | None:
        total, number = self._sums.get(key, (0.0, 0))
        return total / number if number else None
