"""Runs episodes over workers; survives the death of a worker and finds the episode that killed it."""

import time
from collections import deque
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import dataclass

from care_sim.study.config import EpisodeConfig
from care_sim.study.episode import Row, attempt
from care_sim.study.executors import ClusterLost, ExecutorFactory, places, processes
from care_sim.study.journal import Journal

Flying = dict[Future[Row | str], EpisodeConfig]
"""The episodes in flight."""

PATIENCE_S = 2.0
"""How long nothing may happen before the audience is told so."""


@dataclass(frozen=True)
class Failure:
    """An episode that did not finish, and why."""

    config: EpisodeConfig
    reason: str

    def __str__(self) -> str:
        return f"{self.config.label}: {self.reason}"


class Audience:
    """Follows a run; this one keeps quiet."""

    def playing(self, workers: int) -> None:
        """So many workers play now; told every few seconds at least."""

    def finished(self, config: EpisodeConfig, row: Row | None) -> None:
        """An episode has ended; None when it failed."""


def run_all(
    configs: Sequence[EpisodeConfig],
    journal: Journal,
    workers: int,
    make_executor: ExecutorFactory = processes,
    audience: Audience | None = None,
) -> list[Failure]:
    """Run every episode that the journal does not hold yet, seed by seed; returns those that failed.

    An interrupt leaves every finished episode in the journal, in whole pairs but for the last seed. When a
    worker dies, the episodes then in flight are run again one by one, so that only the guilty one fails.
    Raises ClusterLost when a cluster's scheduler is gone.
    """
    run = _Run(journal, workers, make_executor, audience or Audience())
    missing = (config for config in configs if config.digest() not in journal)
    waiting = deque(sorted(missing, key=lambda config: config.seed))
    while waiting:
        for suspect in run.together(waiting):
            run.alone(suspect)
    return run.failures


class _Run:
    def __init__(self, journal: Journal, workers: int, make_executor: ExecutorFactory, audience: Audience):
        self.failures: list[Failure] = []
        self._journal = journal
        self._workers = workers
        self._make_executor = make_executor
        self._audience = audience

    def together(self, waiting: deque[EpisodeConfig]) -> list[EpisodeConfig]:
        """Run until nothing waits or a worker dies; returns the episodes in flight at a death.

        No more are in flight than there are workers, so that few are suspected.
        """
        flying: Flying = {}
        with self._make_executor(min(self._workers, len(waiting))) as executor:
            try:
                while waiting or flying:
                    self._launch(executor, waiting, flying)
                    self._land(flying)
            except BrokenExecutor:
                wait(flying)
        return [config for future, config in flying.items() if not self._kept(config, future)]

    def alone(self, config: EpisodeConfig) -> None:
        """Run one episode in a worker of its own."""
        with self._make_executor(1) as executor:
            future = _submit(executor, config)
            wait([future])
        if not self._kept(config, future):
            self._fail(config, "the worker process died")

    def _launch(self, executor: Executor, waiting: deque[EpisodeConfig], flying: Flying) -> None:
        """Fill the places; a cluster without any gets one episode, which waits for a worker."""
        workers = places(executor, self._workers)
        self._audience.playing(workers)
        while waiting and len(flying) < max(workers, 1):
            flying[_submit(executor, waiting[0])] = waiting[0]
            waiting.popleft()

    def _land(self, flying: Flying) -> None:
        done, _ = wait(flying, PATIENCE_S, FIRST_COMPLETED)
        for future in sorted(done, key=_is_cut_off):
            if not self._kept(flying[future], future):
                raise BrokenExecutor
            del flying[future]

    def _kept(self, config: EpisodeConfig, future: Future[Row | str]) -> bool:
        """Record how an episode ended; False when it was cut off by the death of a worker."""
        error = future.exception()
        if isinstance(error, ClusterLost):
            raise error
        if isinstance(error, BrokenExecutor):
            return False
        if error is None:
            self._record(config, future.result())
        else:
            self._fail(config, " ".join(f"{type(error).__name__}: {error}".split()))
        return True

    def _record(self, config: EpisodeConfig, ending: Row | str) -> None:
        if isinstance(ending, str):
            self._fail(config, ending)
        elif ending["digest"] != config.digest():
            self._fail(config, "the worker runs another version of care-sim or of the policy")
        else:
            self._journal.append(ending)
            self._audience.finished(config, ending)

    def _fail(self, config: EpisodeConfig, reason: str) -> None:
        self.failures.append(Failure(config, reason))
        self._audience.finished(config, None)


def _is_cut_off(future: Future[Row | str]) -> bool:
    return future.exception() is not None


def _submit(executor: Executor, config: EpisodeConfig) -> Future[Row | str]:
    """Hand an episode over; a fork server that does not answer at once on a busy machine is asked again."""
    for patience_s in (0.5, 2.0):
        try:
            return executor.submit(attempt, config)
        except ConnectionError:
            time.sleep(patience_s)
    return executor.submit(attempt, config)
