"""Plays of the benchmark, kept in a journal."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from care_sim.base.errors import InvalidInput
from care_sim.study.executors import ExecutorFactory, processes
from care_sim.study.journal import Journal
from care_sim.study.play_config import PlayConfig
from care_sim.study.progress import run_with_progress
from care_sim.study.results_formats import EPISODES, PLAYS
from care_sim.study.run_config import Row, RunConfig
from care_sim.study.runner import Failure

BENCHMARK_JOURNAL = "benchmark.jsonl"
"""Not the journal of a study, which a folder may hold too."""
_STUDY = "benchmark"


class Player:
    """Plays what its journal does not hold yet; `failures` are the tasks that did not finish."""

    def __init__(self, journal: Journal, workers: int, make_executor: ExecutorFactory):
        self.failures: list[Failure] = []
        self._journal = journal
        self._workers = workers
        self._make_executor = make_executor

    def rows(self, configs: Sequence[RunConfig]) -> list[Row | None]:
        """The row of every configuration; None of one that failed."""
        # A copy has no key yet: its digest is of the code at the time of this run.
        asked = {config: config.changed() for config in configs}
        plays = [own for own in asked.values() if isinstance(own, PlayConfig)]
        episodes = [own for own in asked.values() if not isinstance(own, PlayConfig)]
        for kind, own in ((EPISODES, episodes), (PLAYS, plays)):
            if own:
                self.failures += run_with_progress(
                    own, self._journal, self._workers, self._make_executor, kind
                )
        found = {row["digest"]: row for row in self._journal.rows}
        return [found.get(asked[config].key) for config in configs]


@contextmanager
def player_in(
    folder: Path, workers: int, make_executor: ExecutorFactory = processes
) -> Iterator[Player]:
    """A player whose journal lies in a folder. Raises InvalidInput where it cannot be written."""
    if folder.is_file():
        raise InvalidInput(f"{folder} is a file, a folder is wanted")
    try:
        journal = Journal(folder / BENCHMARK_JOURNAL, _STUDY)
    except OSError as error:
        raise InvalidInput(f"cannot write results to {folder}: {error.strerror}") from error
    with journal:
        yield Player(journal, workers, make_executor)
