"""How far a study has come."""

from collections.abc import Sequence

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from care_sim.study.config import EpisodeConfig
from care_sim.study.executors import ExecutorFactory
from care_sim.study.journal import Journal
from care_sim.study.runner import Failure, run_all


def run_with_progress(
    configs: Sequence[EpisodeConfig], journal: Journal, workers: int, make_executor: ExecutorFactory
) -> list[Failure]:
    """Run the episodes that the journal does not hold yet, with a progress bar; returns those that failed."""
    done = sum(config.digest() in journal for config in configs)
    columns = (TextColumn("episodes"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task = progress.add_task("", total=len(configs), completed=done)
        return run_all(configs, journal, workers, make_executor, lambda: progress.advance(task))
