"""How far a study has come, and how long the rest of it will take: a bar on a terminal, lines from
time to time elsewhere.
"""

import math
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from datetime import timedelta

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from care_sim.base.errors import counted, report_problems
from care_sim.study.executors import ExecutorFactory
from care_sim.study.journal import Journal
from care_sim.study.results_formats import ResultsFormat
from care_sim.study.run_config import Row, RunConfig, SimilarityKey
from care_sim.study.runner import Failure, RunListener, run_all


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


_EARLY = 0.05
"""Share of the tasks after which the prediction is noted, and after which a line is due."""
_FIRST_LINE_S = 10.0
_LINE_S = 60.0
_PATIENCE = (
    "the first take longer on a machine that has not played before: code is compiled there, once; "
    "what is left is told when others have ended"
)

Show = Callable[[int, str], None]
"""Shows how many tasks are done and, in words, what is left."""


def run_with_progress(
    configs: Sequence[RunConfig],
    journal: Journal,
    workers: int,
    make_executor: ExecutorFactory,
    kind: ResultsFormat,
) -> list[Failure]:
    """Run the tasks that the journal does not hold yet, and show on stderr how far they are.

    Returns those that failed; see `care_sim.study.runner.run_all`.
    """
    found = [(config, journal[config.key]["wall_s"]) for config in configs if config.key in journal]
    remaining = RemainingTime((config for config in configs if config.key not in journal), found)
    with shown_progress(len(configs), kind.unit) as show:
        reporter = ProgressReporter(remaining, show, len(configs))
        failures = run_all(
            configs, journal, workers, make_executor, reporter, kind.play_batch, kind.most
        )
    if len(found) < len(configs):
        print(reporter.summary(kind.task), file=sys.stderr)
    return failures


def shown_progress(total: int, unit: str) -> AbstractContextManager[Show]:
    """A bar where stderr is a terminal, lines elsewhere."""
    if sys.stderr.isatty():
        return progress_bar(total, unit)
    return nullcontext(ProgressLines(total, unit))


class ProgressReporter(RunListener):
    """Shows how far a run is, and how long the rest of it should take.

    What was begun before the first task had ended tells nothing of the rest, as the first round of
    a training does not (`care_sim.training.run`): it may have compiled what is not compiled yet.
    """

    def __init__(
        self,
        remaining: RemainingTime,
        show: Show,
        total: int,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._remaining = remaining
        self._show = show
        self._total = total
        self._clock = clock
        self._new = remaining.waiting
        self._started = clock()
        self._workers = 0
        self._end = math.nan
        self._predicted_s = math.nan
        self._predicted_after = 0
        self._any_failed = False
        self._compiling: set[RunConfig] = set()
        self._patience_asked = False

    def begun(self, batch: Sequence[RunConfig]) -> None:
        """Remember what is begun before anything has ended."""
        if self._ended == 0:
            self._compiling.update(batch)

    def playing(self, workers: int) -> None:
        """Show what is left with so many workers."""
        self._ask_for_patience()
        if workers != self._workers:
            self._workers = workers
            self._predict()
        self._tell()

    def finished(self, config: RunConfig, row: Row | None) -> None:
        """Learn how long a task took."""
        took_s = row["wall_s"] if row else 0.0
        self._remaining.finished(config, None if config in self._compiling else took_s)
        self._predict()
        # One prediction is noted early and kept, so that the summary can say how good it was.
        if math.isnan(self._predicted_s) and self._new > self._ended >= _EARLY * self._new:
            self._predicted_s = self._end - self._started
            self._predicted_after = self._ended
        self._tell()

    def failed(self, failure: Failure) -> None:
        """Tell the first failure at once: who made a mistake need not wait for all the others."""
        if not self._any_failed and self._remaining.waiting:
            with suppress(OSError):
                report_problems([f"failed: {failure}; the others go on, Ctrl-C stops"])
        self._any_failed = True

    def interrupted(self) -> None:
        """Say why it takes a moment."""
        with suppress(OSError):  # the terminal may be what is gone
            print("interrupted: what is played now is finished first", file=sys.stderr, flush=True)

    def summary(self, task: str) -> str:
        """How long the tasks took, and how long they should have."""
        took = f"{counted(self._new, task)} took {_exact(self._clock() - self._started)}"
        # Of fewer tasks than twenty, one is more than the share after which a prediction counts.
        if self._new < 1 / _EARLY or math.isnan(self._predicted_s):
            return took
        share = self._predicted_after / self._new
        return f"{took}; {_exact(self._predicted_s)} predicted after {share:.0%}"

    @property
    def _ended(self) -> int:
        """Tasks that have ended in this run."""
        return self._new - self._remaining.waiting

    def _ask_for_patience(self) -> None:
        """Say once why nothing has ended yet."""
        # A terminal is told by `care_sim.base.compiled`, where something is compiled.
        waits = self._ended == 0 and self._clock() - self._started >= _FIRST_LINE_S
        if waits and not self._patience_asked and not sys.stderr.isatty():
            self._patience_asked = True
            print(_PATIENCE, file=sys.stderr, flush=True)

    def _predict(self) -> None:
        self._end = self._clock() + self._remaining.remaining_s(self._workers)

    def _tell(self) -> None:
        left_s = max(self._end - self._clock(), 0.0)
        # A prediction that has run out says nothing of what still plays.
        known = not math.isnan(self._end) and (left_s > 0 or self._remaining.waiting == 0)
        left = f"{rounded_duration(left_s)} left" if known else ""
        waits = self._workers == 0 and self._remaining.waiting > 0
        self._show(
            self._total - self._remaining.waiting, "no worker is connected" if waits else left
        )


@contextmanager
def progress_bar(total: int, unit: str) -> Iterator[Show]:
    """A bar on a terminal."""
    columns = (TextColumn(unit), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    # What is printed meanwhile goes above the bar where both share the terminal. A stdout that goes
    # to a file must not pass through it.
    shared = sys.stdout.isatty()
    left = TextColumn("{task.fields[left]}")
    with Progress(*columns, left, console=Console(stderr=True), redirect_stdout=shared) as progress:
        task = progress.add_task("", total=total, left="")
        yield lambda done, left: progress.update(task, completed=done, left=left)


class ProgressLines:
    """A line after ten seconds, then every minute, or sooner when another twentieth is done."""

    def __init__(self, total: int, unit: str, clock: Callable[[], float] = time.monotonic):
        self._total = total
        self._unit = unit
        self._clock = clock
        self._last_s = clock()
        # So that the first line is due by time alone.
        self._last_done = -total

    def __call__(self, done: int, left: str) -> None:
        """Print a line when it is due."""
        quiet_s = self._clock() - self._last_s
        much = done - self._last_done >= _EARLY * self._total
        if quiet_s >= _LINE_S or (quiet_s >= _FIRST_LINE_S and much):
            self._last_s = self._clock()
            self._last_done = done
            print(
                ", ".join(filter(None, (f"{self._unit} {done}/{self._total}", left))),
                file=sys.stderr,
                flush=True,
            )


def rounded_duration(seconds: float) -> str:
    """A duration as people say it, rounded: 45 s, 12 min, 3 h 20 min."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60} min"


def _exact(seconds: float) -> str:
    return str(timedelta(seconds=round(seconds)))
