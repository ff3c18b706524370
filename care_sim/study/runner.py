"""Runs tasks over workers; survives the death of a worker and finds the batch that killed it."""

import time
from collections import Counter, deque
from collections.abc import Callable, Hashable, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import dataclass
from typing import Any

from care_sim.base.errors import error_line
from care_sim.study.episode_play import MOST_TOGETHER, play_episodes
from care_sim.study.executors import ClusterLost, ExecutorFactory, parallel_batches, processes
from care_sim.study.journal import Journal
from care_sim.study.run_config import Row, RunConfig

Batch = Sequence[RunConfig]
PlayBatch = Callable[[Any], list[Row | str]]
"""Plays a batch in a worker, and returns for each task its row, or the reason of its failure in one
line.
"""
_InFlight = dict[Future[list[Row | str]], Batch]
"""The batches that are being played."""

DIED = "the worker process died"
_OTHER_CODE = (
    "the worker runs another version of care-sim or of the policy, or their files changed while "
    "the study ran"
)
_DEADLY = 3
"""Killed workers after which a policy's other tasks are not tried."""
_QUIET_S = 2.0
"""Longest interval between reports of the number of workers."""


@dataclass(frozen=True)
class Failure:
    """A task that did not finish, with its reason."""

    config: RunConfig
    reason: str

    def __str__(self) -> str:
        return f"{self.config.label}: {self.reason}"


def by_reason(failures: Sequence[Failure], unit: str) -> list[str]:
    """Return the failures, one line per reason."""
    reasons: dict[str, list[Failure]] = {}
    for failure in failures:
        reasons.setdefault(failure.reason, []).append(failure)
    return [
        str(own[0]) if len(own) == 1 else f"{len(own)} {unit}, the first {own[0]}"
        for own in reasons.values()
    ]


def in_batches(tasks: Sequence[RunConfig], most: int | None = None) -> list[list[RunConfig]]:
    """The tasks in the order in which they are played; tasks of one batch stand together, up to
    `most` of them.
    """
    batches: list[list[RunConfig]] = []
    begun: dict[Hashable, list[RunConfig]] = {}
    # The sort is stable: a batch is played when its first task is due.
    for task in sorted(tasks, key=lambda task: task.order):
        key = task.batch
        if key not in begun or len(begun[key]) == most:
            begun[key] = []
            batches.append(begun[key])
        begun[key].append(task)
    return batches


class RunListener:
    """Follows a run; this base class does nothing."""

    def playing(self, workers: int) -> None:
        """Called with the number of workers, at least every few seconds."""

    def begun(self, batch: Batch) -> None:
        """Called when a batch goes to a worker."""

    def finished(self, config: RunConfig, row: Row | None) -> None:
        """Called when a task has ended, with None for a failure."""

    def failed(self, failure: Failure) -> None:
        """Called after `finished` when a task has ended without a row, with the reason."""

    def interrupted(self) -> None:
        """Called at an interrupt: running batches are finished first."""


def run_all(
    configs: Sequence[RunConfig],
    journal: Journal,
    workers: int,
    make_executor: ExecutorFactory = processes,
    listener: RunListener | None = None,
    play_batch: PlayBatch = play_episodes,
    most: int | None = MOST_TOGETHER,
) -> list[Failure]:
    """Run every task that the journal does not hold yet, in their order; returns those that failed.

    A batch has up to `most` tasks, and the last ones are shared among all workers; with None
    related tasks stay together.

    An interrupt waits for running batches and leaves all finished tasks in the journal. After the
    death of a worker, running batches are run again one by one, and in halves, so that only the
    guilty task fails. After a policy has killed `_DEADLY` workers, its other tasks are not tried.
    Raises ClusterLost when the scheduler of a cluster is gone.
    """
    run = _Run(journal, workers, make_executor, listener or RunListener(), play_batch, most)
    due = [config for config in configs if config.key not in journal]
    waiting = deque(in_batches(due, most))
    while waiting:
        # A pool does not report which batch killed a process. All its batches are suspects, and
        # each runs alone before the rest continues.
        for suspect in run.run_together(waiting):
            run.run_alone(suspect)
    return run.failures


class _Run:
    def __init__(
        self,
        journal: Journal,
        workers: int,
        make_executor: ExecutorFactory,
        listener: RunListener,
        play_batch: PlayBatch,
        most: int | None,
    ):
        self.failures: list[Failure] = []
        self._deaths: Counter[str] = Counter()
        self._play_batch = play_batch
        self._parts_last = most is not None
        self._journal = journal
        self._workers = workers
        self._make_executor = make_executor
        self._listener = listener

    def run_together(self, waiting: "deque[list[RunConfig]]") -> list[Batch]:
        """Run until nothing waits or a worker dies; returns the batches that a death cut off.

        No more are in flight than there are workers, so that few are suspected.
        """
        in_flight: _InFlight = {}
        workers = min(self._workers, len(waiting))
        with self._make_executor(workers) as executor:
            try:
                while waiting or in_flight:
                    self._submit_waiting(executor, waiting, in_flight)
                    self._collect_finished(in_flight)
            # A broken pool ends all its futures; the wait lets those that finished just before be
            # kept.
            except BrokenExecutor:
                wait(in_flight)
            except KeyboardInterrupt:
                self._listener.interrupted()
                wait(in_flight)
                for future, batch in in_flight.items():
                    self._kept(batch, future)
                raise
        return [batch for future, batch in in_flight.items() if not self._kept(batch, future)]

    def run_alone(self, batch: Batch) -> None:
        """Run one batch in a worker of its own; in halves, when that one dies too."""
        batch = self._without_deadly(batch)
        if not batch:
            return
        with self._make_executor(1) as executor:
            future = self._submit(executor, batch)
            wait([future])
        if self._kept(batch, future):
            return
        # A single task that dies alone is guilty. A larger batch is halved until the guilty task is
        # alone.
        if len(batch) == 1:
            self._deaths[batch[0].policy] += 1
            self._fail(batch, DIED)
            return
        for half in (batch[: len(batch) // 2], batch[len(batch) // 2 :]):
            self.run_alone(half)

    def _without_deadly(self, batch: Batch) -> list[RunConfig]:
        """The tasks of a batch but for those of deadly policies, which fail."""
        self._fail(
            [task for task in batch if self._deaths[task.policy] >= _DEADLY],
            f"{DIED} {_DEADLY} times before",
        )
        return [task for task in batch if self._deaths[task.policy] < _DEADLY]

    def _submit_waiting(
        self, executor: Executor, waiting: "deque[list[RunConfig]]", in_flight: _InFlight
    ) -> None:
        """Submit as many batches as run in parallel. A cluster without workers gets one, which
        waits for a worker.
        """
        workers = parallel_batches(executor, self._workers)
        self._listener.playing(workers)
        while waiting and len(in_flight) < max(workers, 1):
            waiting[0] = self._without_deadly(waiting[0])
            if self._parts_last:
                _part_last(waiting, workers)
            if waiting[0]:
                in_flight[self._submit(executor, waiting[0])] = waiting[0]
            waiting.popleft()

    def _collect_finished(self, in_flight: _InFlight) -> None:
        done, _ = wait(in_flight, _QUIET_S, FIRST_COMPLETED)
        # Whole batches first, so that they are in the journal before a death is reported.
        for future in sorted(done, key=lambda future: future.exception() is not None):
            if not self._kept(in_flight[future], future):
                raise BrokenExecutor
            del in_flight[future]

    def _kept(self, batch: Batch, future: Future[list[Row | str]]) -> bool:
        """Record how a batch ended; False when it was cut off by the death of a worker."""
        error = future.exception()
        if isinstance(error, ClusterLost):
            raise error
        if isinstance(error, BrokenExecutor):
            return False
        if error is None:
            for config, ending in zip(batch, future.result(), strict=True):
                self._record(config, ending)
        else:
            self._fail(batch, f"a worker could not play it: {error_line(error)}")
        return True

    def _record(self, config: RunConfig, ending: Row | str) -> None:
        if isinstance(ending, str):
            self._fail([config], ending)
        # The worker computed the digest from its own code and files.
        elif ending["digest"] != config.key:
            self._fail([config], _OTHER_CODE)
        # An interrupt may come between the rows of a batch, all of which are recorded after it.
        elif config.key not in self._journal:
            self._journal.append(ending)
            self._listener.finished(config, ending)

    def _fail(self, batch: Batch, reason: str) -> None:
        for config in batch:
            self.failures.append(Failure(config, reason))
            self._listener.finished(config, None)
            self._listener.failed(self.failures[-1])

    def _submit(self, executor: Executor, batch: Batch) -> Future[list[Row | str]]:
        """Submit a batch, and notify the listener.

        A fork server may be slow on a busy machine, or be killed while it starts a worker. The call
        is repeated: another server replaces it.
        """
        self._listener.begun(batch)
        for wait_s in (0.5, 2.0):
            try:
                return executor.submit(self._play_batch, batch)
            except (ConnectionError, EOFError):
                time.sleep(wait_s)
        return executor.submit(self._play_batch, batch)


def _part_last(waiting: "deque[list[RunConfig]]", workers: int) -> None:
    """Cut the first of the last batches to a worker's share of waiting tasks, so that no worker
    idles while another has many tasks.
    """
    if len(waiting) < 2 * workers:
        share = -(-sum(map(len, waiting)) // workers)
        first = waiting.popleft()
        if rest := first[share:]:
            waiting.appendleft(rest)
        waiting.appendleft(first[:share])
