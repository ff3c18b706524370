"""Runs episodes over processes; survives the death of a worker and finds the episode that killed it."""

import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import dataclass

from care_sim.errors import InvalidInput
from care_sim.study.config import EpisodeConfig
from care_sim.study.episode import Row, run_episode
from care_sim.study.executors import ExecutorFactory, processes
from care_sim.study.journal import Journal


@dataclass(frozen=True)
class Failure:
    """An episode that did not finish, and why."""

    config: EpisodeConfig
    reason: str

    def __str__(self) -> str:
        return f"{self.config.label}: {self.reason}"


def run_all(
    configs: Sequence[EpisodeConfig],
    journal: Journal,
    workers: int,
    make_executor: ExecutorFactory = processes,
    on_done: Callable[[], None] = lambda: None,
) -> list[Failure]:
    """Run every episode that the journal does not hold yet; returns those that failed.

    `on_done` is called after each. An interrupt leaves every finished episode in the journal. When a
    worker dies, the episodes then in flight are run again one by one, so that only the guilty one fails.
    """
    run = _Run(journal, workers, make_executor, on_done)
    waiting = deque(config for config in configs if config.digest() not in journal)
    while waiting:
        for suspect in run.together(waiting):
            run.alone(suspect)
    return run.failures


class _Run:
    def __init__(self, journal: Journal, workers: int, make_executor: ExecutorFactory, on_done: Callable[[], None]):
        self.failures: list[Failure] = []
        self._journal = journal
        self._workers = workers
        self._make_executor = make_executor
        self._on_done = on_done

    def together(self, waiting: deque[EpisodeConfig]) -> list[EpisodeConfig]:
        """Run until nothing waits or a worker dies; returns the episodes in flight at a death.

        No more are in flight than there are workers, so that few are suspected.
        """
        flying: dict[Future[Row], EpisodeConfig] = {}
        with self._make_executor(min(self._workers, len(waiting))) as executor:
            try:
                while waiting or flying:
                    while waiting and len(flying) < self._workers:
                        flying[_submit(executor, waiting[0])] = waiting[0]
                        waiting.popleft()
                    self._land(flying)
            except BrokenExecutor:
                wait(flying)
        return [config for future, config in flying.items() if not self._kept(config, future)]

    def alone(self, config: EpisodeConfig) -> None:
        """Run one episode in a worker of its own."""
        with self._make_executor(1) as executor:
            future = _submit(executor, config)
            wait([future])
        if isinstance(future.exception(), BrokenExecutor):
            self._fail(config, "the worker process died")
        else:
            self._kept(config, future)

    def _land(self, flying: dict[Future[Row], EpisodeConfig]) -> None:
        done, _ = wait(flying, return_when=FIRST_COMPLETED)
        for future in done:
            if not self._kept(flying[future], future):
                raise BrokenExecutor
            del flying[future]

    def _kept(self, config: EpisodeConfig, future: Future[Row]) -> bool:
        """Record how an episode ended; False when it was cut off by the death of a worker."""
        error = future.exception()
        if isinstance(error, BrokenExecutor):
            return False
        if error is None and future.result()["digest"] != config.digest():
            self._fail(config, "the worker runs another version of care-sim")
        elif error is None:
            self._journal.append(future.result())
            self._on_done()
        else:
            self._fail(config, str(error) if isinstance(error, InvalidInput) else f"{type(error).__name__}: {error}")
        return True

    def _fail(self, config: EpisodeConfig, reason: str) -> None:
        self.failures.append(Failure(config, reason))
        self._on_done()


def _submit(executor: Executor, config: EpisodeConfig) -> Future[Row]:
    """Hand an episode over; a fork server that does not answer at once on a busy machine is asked again."""
    for patience_s in (0.5, 2.0):
        try:
            return executor.submit(run_episode, config)
        except ConnectionError:
            time.sleep(patience_s)
    return executor.submit(run_episode, config)
