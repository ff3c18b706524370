"""How a command plays a study: over workers, into a folder, and naming what is left out."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from care_sim.base.bounds import bounded, check_fields
from care_sim.base.errors import report_problems
from care_sim.commands.shared.run_study import run_study, summary
from care_sim.reports.report import print_report, read_results
from care_sim.reports.studies import STUDIES
from care_sim.study import executors
from care_sim.study.executors import CORES, MOST_WORKERS
from care_sim.study.run_config import RunConfig

DONE = 0
FAILED = 1
_PIPE_WIDTH = 180
"""Columns of a table that is not printed on a terminal."""


@dataclass(frozen=True, kw_only=True)
class StudyCommand:
    """Options of every command that plays a study."""

    workers: int = bounded(CORES, 1, MOST_WORKERS)
    """Processes that play at the same time on this machine; a cluster plays as many tasks as it has
    threads.
    """
    cluster: str | None = None
    """Address of a dask scheduler whose workers play instead, for example tcp://HOST:8786 (extra
    'cluster').
    """
    force: bool = False
    """Play into a folder that holds another study, finished or not, or rows that are not asked for
    now: its tables, figures and Parquet files are replaced at the end; its journal stays. Episodes
    never replace the plays of a protocol, nor plays episodes: their files have other names."""

    def __post_init__(self) -> None:
        check_fields(self)

    def play_study(
        self, study: str, configs: Sequence[RunConfig], out: Path, left_out: Sequence[str] = ()
    ) -> int:
        """Play the tasks and print their tables, the tasks that failed and the policies that were
        left out.
        """
        make_executor = executors.cluster(self.cluster) if self.cluster else executors.processes
        failures = run_study(configs, out, self.workers, make_executor, STUDIES[study], self.force)
        # What is printed is read back from the folder, as `care-sim report` would print it.
        if len(failures) < len(configs):
            rows, _, missing = read_results(out)
            print_report(rows, console(), STUDIES[study], missing)
            print(f"Results are in {out}")
        report_problems(
            [
                *(f"failed: {line}" for line in summary(failures, STUDIES[study].results.unit)),
                *left_out,
            ]
        )
        return FAILED if failures or left_out else DONE


def console() -> Console:
    """Where tables are printed: a terminal, or a pipe of a width at which tables need no breaks."""
    width = None if sys.stdout.isatty() else _PIPE_WIDTH
    return Console(highlight=False, width=width)
