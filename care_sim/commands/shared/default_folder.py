"""Where a study goes for which no folder is given."""

import sys
from collections.abc import Sequence
from pathlib import Path

from care_sim.base.errors import InvalidInput, print_lines
from care_sim.commands.shared.folder_checks import (
    WAYS_OUT,
    check_journal,
    check_kind,
    check_results,
)
from care_sim.reports.study import Study
from care_sim.study.journal import JOURNAL, is_written, read_journal
from care_sim.study.run_config import RunConfig

_RUNS = Path("runs")


def free_folder(name: str, configs: Sequence[RunConfig], study: Study) -> Path:
    """The first of runs/NAME, runs/NAME-2 and so on that the study may take: where nothing lies, or
    only rows that are all asked for now, which it goes on with. A line says why another is not it.
    """
    folder, number = _RUNS / name, 1
    first = reason = _why_not(folder, configs, study)
    while reason:
        number += 1
        folder = _RUNS / f"{name}-{number}"
        reason = _why_not(folder, configs, study)
    if first:
        print_lines(f"another folder is taken, because {first}", file=sys.stderr)
    return folder


def _why_not(folder: Path, configs: Sequence[RunConfig], study: Study) -> str:
    """Why the study may not take the folder; empty where it may."""
    if folder.is_file():
        return f"{folder} is a file"
    if is_written(folder / JOURNAL):
        return f"another study writes to {folder} now"
    try:
        check_kind(folder, study)
        check_results(folder, configs, study)
        check_journal(folder, configs, read_journal(folder / JOURNAL), study)
    except InvalidInput as error:
        return str(error).removesuffix(f": {WAYS_OUT}")
    return ""
