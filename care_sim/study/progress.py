"""Progress of a study and its remaining time: a bar on a terminal, occasional lines elsewhere."""

import math
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import timedelta

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from care_sim.base.errors import counted, report_problems
from care_sim.study.executors import ExecutorFactory
from care_sim.study.journal import Journal
from care_sim.study.results_formats import ResultsFormat
from care_sim.study.run_config import Row, RunConfig
from care_sim.study.runner import Failure, RunListener, run_all

_TWENTIETH = 0.05
"""Share of the tasks after which a line is due."""
_FIRST_LINE_S = 10.0
_LINE_S = 60.0
_FIRST_ROUND = "the first take longer on a machine that has not played before, which compiles code"

Show = Callable[[int, str], None]
"""Shows the number of finished tasks and, in words, the remaining time."""


def run_with_progress(
    configs: Sequence[RunConfig],
    journal: Journal,
    workers: int,
    make_executor: ExecutorFactory,
    kind: ResultsFormat,
) -> list[Failure]:
    """Run the tasks that the journal lacks, and show progress on stderr.

    Returns failed tasks; see `care_sim.study.runner.run_all`.
    """
    waiting = [config for config in configs if config.key not in journal]
    started = time.monotonic()
    with shown_progress(len(configs), kind.unit) as show:
        reporter = ProgressReporter(waiting, show, len(configs))
        failures = run_all(
            configs, journal, workers, make_executor, reporter, kind.play_batch, kind.most
        )
    if waiting:
        took = timedelta(seconds=round(time.monotonic() - started))
        print(f"{counted(len(waiting), kind.task)} took {took}", file=sys.stderr)
    return failures


class ProgressReporter(RunListener):
    """Shows the progress of a run, and its remaining time. The estimate is the mean of ended tasks
    of the same policy, or of all tasks.

    Tasks begun before the first one ended are ignored, as in trainings (`care_sim.training.run`):
    they may have compiled code.
    """

    def __init__(self, waiting: Iterable[RunConfig], show: Show, total: int) -> None:
        self._waiting = Counter(config.policy for config in waiting)
        self._new = self._waiting.total()
        self._show = show
        self._total = total
        self._workers = 0
        self._seconds: dict[str, float] = {}
        self._measured: Counter[str] = Counter()
        self._first_round: set[RunConfig] = set()
        self._any_failed = False

    def begun(self, batch: Sequence[RunConfig]) -> None:
        """Remember tasks that begin before any has ended."""
        if self._waiting.total() == self._new:
            self._first_round.update(batch)

    def playing(self, workers: int) -> None:
        """Show the remaining time with this many workers."""
        self._workers = workers
        self._tell()

    def finished(self, config: RunConfig, row: Row | None) -> None:
        """Record the time of a task."""
        self._waiting[config.policy] -= 1
        if row and config not in self._first_round:
            took_s = self._seconds.get(config.policy, 0.0) + row["wall_s"]
            self._seconds[config.policy] = took_s
            self._measured[config.policy] += 1
        self._tell()

    def failed(self, failure: Failure) -> None:
        """Report the first failure at once, so that users need not wait for the others."""
        if not self._any_failed and self._waiting.total():
            with suppress(OSError):
                report_problems([f"failed: {failure}; the others go on, Ctrl-C stops"])
        self._any_failed = True

    def interrupted(self) -> None:
        """Explain the delay."""
        with suppress(OSError):  # the terminal may be what is gone
            print("interrupted: what is played now is finished first", file=sys.stderr, flush=True)

    def remaining_s(self) -> float:
        """Seconds until the last task ends; NaN while nothing is known."""
        waiting = +self._waiting
        if not waiting:
            return 0.0
        took_s, measured = self._seconds, self._measured
        usual = sum(took_s.values()) / measured.total() if took_s else math.nan
        means = {policy: seconds / measured[policy] for policy, seconds in took_s.items()}
        expected = {policy: means.get(policy, usual) for policy in waiting}
        work = sum(number * expected[policy] for policy, number in waiting.items())
        # The work shared evenly, but never less than the longest task, which no second worker
        # shortens.
        return max(work / max(self._workers, 1), max(expected.values()))

    def _tell(self) -> None:
        waiting = self._waiting.total()
        left_s = self.remaining_s()
        left = "" if math.isnan(left_s) else f"{rounded_duration(left_s)} left"
        if waiting and not self._workers:
            left = "no worker is connected"
        self._show(self._total - waiting, left)


@contextmanager
def shown_progress(total: int, unit: str) -> Iterator[Show]:
    """A bar where stderr is a terminal, lines elsewhere."""
    if not sys.stderr.isatty():
        yield ProgressLines(total, unit)
        return
    columns = (TextColumn(unit), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    # Output goes above the bar if both share the terminal. A stdout to a file must not pass through
    # the bar.
    shared = sys.stdout.isatty()
    left = TextColumn("{task.fields[left]}")
    with Progress(*columns, left, console=Console(stderr=True), redirect_stdout=shared) as progress:
        task = progress.add_task("", total=total, left="")
        yield lambda done, left: progress.update(task, completed=done, left=left)


class ProgressLines:
    """Prints a line after ten seconds, then every minute, or sooner when another twentieth is
    done.
    """

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
        much = done - self._last_done >= _TWENTIETH * self._total
        if quiet_s >= _LINE_S or (quiet_s >= _FIRST_LINE_S and much):
            self._last_s = self._clock()
            self._last_done = done
            told = [f"{self._unit} {done}/{self._total}", left or ("" if done else _FIRST_ROUND)]
            print(", ".join(filter(None, told)), file=sys.stderr, flush=True)


def rounded_duration(seconds: float) -> str:
    """Return a rounded duration: 45 s, 12 min, 3 h 20 min."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60} min"
