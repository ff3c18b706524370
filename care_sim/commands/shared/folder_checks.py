"""Which folder a study may take: what is there already, and whether the new rows hold all of it."""

import sys
from collections.abc import Sequence
from pathlib import Path

from care_sim.base.errors import InvalidInput, counted, print_lines
from care_sim.reports.studies import SWEEP
from care_sim.reports.study import Study
from care_sim.study.journal import JOURNAL, Finished, Journal, is_written, read_journal
from care_sim.study.results_formats import RESULTS_FORMATS
from care_sim.study.rows.checks import USUAL, asked_with, identity, row_label
from care_sim.study.rows.parquet import read_notes, read_rows
from care_sim.study.run_config import Row, RunConfig

WAYS_OUT = "give another --out, or --force to replace it"
_MOST_TOLD = 3
"""Differing parameters that a refusal names, at the most."""


def free_folder(name: str, configs: Sequence[RunConfig], study: Study) -> Path:
    """The first of runs/NAME, runs/NAME-2 and so on that the study may take: where nothing lies, or
    only rows that are all asked for now, which it goes on with. A line says why another is not it.
    """
    folder, number = Path("runs", name), 1
    first = reason = _why_not(folder, configs, study)
    while reason:
        number += 1
        folder = Path("runs", f"{name}-{number}")
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
        check_folder(folder, configs, study, read_journal(folder / JOURNAL))
    except InvalidInput as error:
        return str(error).removesuffix(f": {WAYS_OUT}")
    return ""


def check_folder(
    folder: Path,
    configs: Sequence[RunConfig],
    study: Study,
    journal: Journal | Finished | None = None,
    force: bool = False,
) -> None:
    """Raise InvalidInput where the study may not use the folder. That is where the folder holds
    results of the other kind (episodes or plays), or, without `force`, where results or a journal's
    rows would be lost. Raises as `read_rows` does where results are damaged.
    """
    # Each kind has files of its own, so that --force would leave both in one folder.
    kind = study.results
    for other in RESULTS_FORMATS:
        if other is not kind and (folder / other.file).exists():
            raise InvalidInput(
                f"{folder} holds {other.unit} of another study; the {kind.unit} of the study "
                f"{study.name} need another --out, with --force too"
            )
    if force:
        return
    if (folder / kind.file).is_file():
        _check_results(folder, configs, study)
    elif journal and journal.rows:
        _check_journal(folder, configs, journal, study)


def _check_results(folder: Path, configs: Sequence[RunConfig], study: Study) -> None:
    path, task = folder / study.results.file, study.results.task
    # A file that names no study was written by a version that had sweeps alone.
    there = read_notes(path)[0] or SWEEP.name
    rows = read_rows(path, study.results.schema.lenient)
    here, wanted = counted(len(rows), task), counted(len(configs), task)
    if there != study.name:
        raise InvalidInput(
            f"{folder} holds the study {there}, {here}, which the study {study.name}, {wanted}, "
            f"would replace: {WAYS_OUT}"
        )
    if gone := _gone(rows, configs):
        raise InvalidInput(
            f"{folder} holds {here} of the study {there}; {len(gone)} of them, the first "
            f"{_first(gone, configs)}, would be gone from the study {study.name} that is asked "
            f"for, {wanted}: {WAYS_OUT}"
        )


def _check_journal(
    folder: Path, configs: Sequence[RunConfig], journal: Journal | Finished, study: Study
) -> None:
    """The same of an interrupted study, whose own command would be refused as soon as these results
    lie there. A row counts by its parameters, whatever code played it, so that a command goes on
    after a change of the code.
    """
    rows = counted(len(journal.rows), "row")
    held = f"{folder} holds the unfinished study {' and '.join(sorted(journal.studies))}, {rows}"
    if study.name not in journal.studies:
        raise InvalidInput(
            f"{held}, beside which the study {study.name} would be played: {WAYS_OUT}"
        )
    if gone := _gone(journal.rows, configs):
        raise InvalidInput(
            f"{held}; {len(gone)} of them, the first {_first(gone, configs)}, are not asked for "
            "now: give the command that began it, another --out, or --force to play beside them"
        )


def lost(folder: Path, played: Sequence[RunConfig], study: Study) -> str:
    """One line that tells which rows of the folder would be lost because tasks failed; empty for
    none.
    """
    path, task = folder / study.results.file, study.results.task
    rows = read_rows(path, study.results.schema.lenient) if path.is_file() else []
    gone = _gone(rows, played)
    if not gone:
        return ""
    return (
        f"the results in {folder} stay as they were: {len(gone)} of their "
        f"{counted(len(rows), task)}, the first {row_label(gone[0])}, would be gone, since this "
        f"time only {counted(len(played), task)} did not fail; the journal keeps what was "
        "played: mend what failed, or --force to replace them"
    )


def _gone(rows: Sequence[Row], configs: Sequence[RunConfig]) -> list[Row]:
    """The rows that are none of `configs`."""
    own = {identity(config.row()) for config in configs}
    return [row for row in rows if identity(row) not in own]


def _first(gone: Sequence[Row], configs: Sequence[RunConfig]) -> str:
    """The first of the rows and, in brackets, the parameters in which it differs from the nearest
    task with the same label, where one has that label.
    """
    label, there = row_label(gone[0]), asked_with(gone[0])
    found = []
    for now in (asked_with(row) for row in (c.row() for c in configs) if row_label(row) == label):
        names = [name for name in sorted({*there, *now}) if there.get(name) != now.get(name)]
        found.append(
            [
                f"{name} {_format_value(name, there)}, now {_format_value(name, now)}"
                for name in names
            ]
        )
    nearest = min(found, key=len, default=[])
    return f"{label} ({'; '.join(nearest[:_MOST_TOLD])})" if nearest else label


def _format_value(name: str, asked: Row) -> str:
    value = asked.get(name, USUAL.get(name))
    return "not given" if value is None else str(value)
