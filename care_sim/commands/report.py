"""`care-sim report`: the tables and figures of a folder of results again, or one web page."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from care_sim.base.bounds import bounded, check_fields
from care_sim.base.checks import LARGEST_INTEGER
from care_sim.base.errors import InvalidInput, counted, print_lines, report_problems
from care_sim.commands.shared.play_options import SourceOptions
from care_sim.commands.shared.study_command import FAILED, console
from care_sim.reports.report import (
    StudyReport,
    next_steps,
    print_minus,
    print_report,
    read_results,
)
from care_sim.study.executors import MOST_WORKERS, WORKERS


@dataclass(frozen=True, kw_only=True)
class PrintReport(SourceOptions):
    """Print a folder's tables and figures again, or make one page.

    Print the tables of a folder of results and draw its figures again, or make one web page of
    it all.
    """

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER")]
    """The --out of an earlier study."""
    page: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """HTML file for the page, which needs no other file; the folder is left as it is."""
    minus: str | None = None
    """Print this policy less each of the others, with intervals, in place of the tables; the folder
    is left as it is. Of one with parameters the whole name in the tables."""
    verbose: bool = False
    """Print all tables."""
    episodes: int = bounded(40, 0, LARGEST_INTEGER)
    """At most this many episodes are played again for the page, seed by seed; 0 for none. They take
    as long as they did in the study."""
    workers: int = bounded(WORKERS, 1, MOST_WORKERS)
    """Processes that play them."""
    source: str | None = None
    """Where the recordings lie that a study of the open loop played, for its page:
    argoverse2:FOLDER, nuscenes:FOLDER, kitti:FOLDER, sweeps:FOLDER, boreas, or a source of your
    own. Streets need none."""

    def __post_init__(self) -> None:
        check_fields(self)
        if self.source is None and (given := self.source_options()):
            raise InvalidInput(f"--{given[0].replace('_', '-')} has no meaning without --source")
        if self.source is not None and self.page is None:
            raise InvalidInput("--source has no meaning without --page: nothing is played again")
        if self.source is not None and not self.episodes:
            raise InvalidInput("--source has no meaning with --episodes 0: nothing is played again")
        if self.minus is not None and self.page is not None:
            raise InvalidInput("--minus has no meaning with --page: a page draws its own pairs")

    def __call__(self) -> int:
        """Run it."""
        if self.minus is not None:
            rows, study, left_out = read_results(self.folder)
            print_minus(rows, console(), study, self.minus)
            report_problems([f"left out: {what}" for what in left_out])
            return 0
        return self._print() if self.page is None else self._write(self.page)

    def _print(self) -> int:
        rows, study, left_out = read_results(self.folder)
        report = StudyReport.of(rows, study, left_out)
        try:
            report.write(self.folder)
        except (OSError, InvalidInput) as error:
            print_report(rows, console(), study, left_out, verbose=self.verbose)
            report_problems([f"tables and figures in {self.folder} are not written anew: {error}"])
            return FAILED
        print_report(rows, console(), study, left_out, verbose=self.verbose)
        print_lines(*next_steps(self.folder, study, rows))
        return 0

    def _write(self, path: Path) -> int:
        # Imported here because it imports Jinja: tables and figures do not need it.
        from care_sim.reports.page.build import write_page

        source = None if self.source is None else self.source_named(self.source)
        page = write_page(self.folder, path, self.episodes, self.workers, source=source)
        report_problems(page.warnings)
        print_lines(
            f"{path}: {path.stat().st_size / 1e6:.1f} MB, {counted(page.watchable, 'episode')} to "
            "watch"
        )
        return 0
