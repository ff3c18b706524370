"""`care-sim merge`: folders of one study in one, so that their policies are compared in pairs."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from care_sim.base.errors import InvalidInput, counted, print_lines, report_problems
from care_sim.commands.shared.study_command import DONE, console
from care_sim.reports.merging import Merged, merged
from care_sim.reports.report import next_steps, print_report


@dataclass(frozen=True, kw_only=True)
class Merge:
    """Put folders of one study in one, so that tables compare them.

    Put the rows of several folders of one study into a new folder, with tables and figures of them
    all: what you played stands beside what was published, seed by seed. A task that two folders
    hold is kept once, and must have come out alike.
    """

    folders: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER...")]
    """The --out of earlier studies of one name, two at least."""
    out: Path = Path("runs/merge")
    """A folder that does not exist, or is empty."""
    verbose: bool = False
    """Print all tables."""

    def __call__(self) -> int:
        """Run it."""
        if len(self.folders) < 2:
            raise InvalidInput("merge wants two folders at least; report shows one")
        if self.out.exists() and (not self.out.is_dir() or any(self.out.iterdir())):
            raise InvalidInput(f"{self.out} is there already and not empty: give another --out")
        whole = merged(self.folders)
        whole.write(self.out)
        print_report(whole.rows, console(), whole.study, whole.left_out, verbose=self.verbose)
        print_lines(*next_steps(self.out, whole.study, whole.rows))
        if whole.twice:
            alike = counted(whole.twice, whole.study.results.task)
            print(f"Alike in two of the folders, and kept once: {alike}")
        report_problems([*_doubts(whole)])
        return DONE


def _doubts(whole: Merged) -> Iterator[str]:
    """What whoever reads the tables should know."""
    for folder in whole.apart:
        yield (
            f"nothing shows that the worlds of {folder} are those of the others: other code played "
            "it, and it has no task in common with them; play full in both"
        )
    if whole.uneven:
        yield (
            "not all policies were played in the same worlds: levels are each one's own, "
            "differences those of the worlds that two share"
        )
