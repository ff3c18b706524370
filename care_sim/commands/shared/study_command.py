"""How a command plays a study: over workers, into a folder, and naming what is left out."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rich.console import Console

from care_sim.base.bounds import bounded, check_fields
from care_sim.base.console import TableConsole
from care_sim.base.errors import print_lines, report_problems
from care_sim.commands.shared.command_line import command_line
from care_sim.commands.shared.default_folder import free_folder
from care_sim.commands.shared.run_study import run_study, summary
from care_sim.reports.report import next_steps, print_report, read_results
from care_sim.reports.studies import STUDIES
from care_sim.study import executors
from care_sim.study.executors import MOST_WORKERS, WORKERS
from care_sim.study.run_config import RunConfig

DONE = 0
FAILED = 1


@dataclass(frozen=True, kw_only=True)
class StudyCommand:
    """Options of every command that plays a study."""

    workers: int = bounded(WORKERS, 1, MOST_WORKERS)
    """Processes that play at the same time on this machine; a cluster plays as many tasks as it has
    threads.
    """
    cluster: str | None = None
    """Address of a dask scheduler whose workers play instead, for example tcp://HOST:8786 (extra
    'cluster').
    """
    out: Path | None = None
    """Folder of the results; an interrupted study goes on there. Without this option it is in runs/
    and has the name of the command: the first of them, such as runs/sweep and runs/sweep-2, that
    holds no results of other options.
    """
    force: bool = False
    """Play into a folder that holds another study, finished or not, or rows that are not asked for
    now: its tables, figures and Parquet files are replaced at the end; its journal stays. Episodes
    never replace the plays of a protocol, nor plays episodes: their files have other names."""

    verbose: bool = False
    """Print all tables."""

    def __post_init__(self) -> None:
        check_fields(self)

    def folder(self, study: str, configs: Sequence[RunConfig], name: str) -> Path:
        """Where the results of the tasks go, in runs/ under `name` unless it is told."""
        if self.out is not None:
            return self.out
        return Path("runs", name) if self.force else free_folder(name, configs, STUDIES[study])

    def play_study(
        self, study: str, configs: Sequence[RunConfig], name: str, left_out: Sequence[str] = ()
    ) -> int:
        """Play the tasks and print their tables, the tasks that failed and the policies that were
        left out.
        """
        make_executor = executors.cluster(self.cluster) if self.cluster else executors.processes
        out = self.folder(study, configs, name)
        again = command_line(replace(self, out=out))
        failures = run_study(
            configs, out, self.workers, make_executor, STUDIES[study], self.force, again
        )
        # What is printed is read back from the folder, as `care-sim report` would print it.
        if len(failures) < len(configs):
            rows, _, missing = read_results(out)
            print_report(rows, console(), STUDIES[study], missing, verbose=self.verbose)
            print_lines(*next_steps(out, STUDIES[study], rows))
        report_problems(
            [
                *(f"failed: {line}" for line in summary(failures, STUDIES[study].results.unit)),
                *left_out,
            ]
        )
        return FAILED if failures or left_out else DONE


def console() -> Console:
    """Where tables are printed: as wide as the terminal, and 80 columns where there is none."""
    return TableConsole()
