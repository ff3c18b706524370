"""A study from configurations to a folder of results, and a report of what lies in one."""

import json
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from care_sim.errors import InvalidInput
from care_sim.files import write_text
from care_sim.study.executors import ExecutorFactory, processes
from care_sim.study.figures import remove_others, save
from care_sim.study.journal import Journal
from care_sim.study.kinds import KINDS, Kind, kind_in
from care_sim.study.latex import PREAMBLE, latex, paragraph
from care_sim.study.progress import run_with_progress
from care_sim.study.provenance import machine, versions
from care_sim.study.rows import read_notes, read_rows, write_columns, write_rows
from care_sim.study.runner import Failure
from care_sim.study.studies import STUDIES, SWEEP, Study, study_of
from care_sim.study.task import Row, Task

JOURNAL = "journal.jsonl"


def conduct(
    configs: Sequence[Task],
    folder: Path,
    workers: int,
    make_executor: ExecutorFactory = processes,
    study: Study = SWEEP,
) -> list[Failure]:
    """Run a study into `folder`, going on where an earlier run stopped; returns the tasks that failed.

    Writes `journal.jsonl` as they finish; then, if there are any, `config.json` with the configurations and what
    failed, the Parquet files of the study's kind with the rows of `configs` in their order, `tables.md`, `tables.tex`
    and the figures of `study`. Raises InvalidInput for no task or no worker, and when the folder cannot be written.
    """
    if not configs:
        raise InvalidInput("a study needs at least one value on every axis")
    kind = study.kind
    _check_kind(folder, kind)
    if workers < 1:
        raise InvalidInput(f"workers must be a whole number >= 1, got {workers}")
    with _journal(folder) as journal:
        _say_what_is_found(configs, journal, folder, kind.unit)
        failures = run_with_progress(configs, journal, workers, make_executor, kind)
        rows = [journal[digest] for digest in (config.digest() for config in configs) if digest in journal]
    if rows:
        left_out = summary(failures, kind.unit)
        write_text(folder / "config.json", _description(configs, study, failures))
        for name, columns in kind.aside(rows).items():
            write_columns(columns, folder / name)
        rows = kind.finish(rows)
        write_rows(rows, folder / kind.file, study.name, left_out)
        write_report(rows, folder, study, left_out)
    return failures


def summary(failures: Sequence[Failure], unit: str) -> list[str]:
    """What failed, in a line for every reason."""
    by_reason: dict[str, list[Failure]] = {}
    for failure in failures:
        by_reason.setdefault(failure.reason, []).append(failure)
    return [str(own[0]) if len(own) == 1 else f"{len(own)} {unit}, the first {own[0]}" for own in by_reason.values()]


def reported(folder: Path) -> tuple[list[Row], Study, list[str]]:
    """The rows in a folder of results, their study, and what is missing. Raises InvalidInput where there are none."""
    kind = kind_in(folder)
    if (folder / JOURNAL).is_file() and not (folder / kind.file).is_file():
        raise InvalidInput(f"{folder} holds an unfinished study; the command that began it goes on there")
    path = folder / kind.file
    return read_rows(path, kind.required), study_of(path), read_notes(path)[1]


def write_report(rows: Sequence[Row], folder: Path, study: Study = SWEEP, left_out: Sequence[str] = ()) -> None:
    """Write tables and figures into a folder; figures of an earlier study are removed."""
    tables, closing = study.tables(rows), [*study.closing(rows), *map(_left_out, left_out)]
    statements = "## Statements\n\n" + "".join(f"- {sentence}\n" for sentence in closing)
    pages = [f"{study.caption}\n", *(table.markdown() for table in tables), statements]
    write_text(folder / "tables.md", "\n".join(pages))
    texts = [paragraph(study.caption), *map(latex, tables), *map(paragraph, closing)]
    write_text(folder / "tables.tex", "\n".join([PREAMBLE, *texts]))
    figures = study.figures(rows)
    remove_others(folder, (name for known in STUDIES.values() for name in known.figure_names), figures)
    for name, figure in figures.items():
        save(figure, folder / name)


def print_report(rows: Sequence[Row], console: Console, study: Study = SWEEP, left_out: Sequence[str] = ()) -> None:
    """Print the tables, how to read them, and the closing sentences."""
    for table in study.tables(rows):
        if table.terminal:
            console.print(table.rich())
            console.print()
    for sentence in (study.caption, *study.closing(rows), *map(_left_out, left_out)):
        console.print(sentence, markup=False)


def _left_out(what: str) -> str:
    return f"Left out: {what}."


def _description(configs: Sequence[Task], study: Study, failures: Sequence[Failure]) -> str:
    settings = {"study": study.name, "versions": versions(), "machine": machine(), "failed": [*map(str, failures)]}
    return json.dumps(settings | study.kind.listed(configs), indent=1) + "\n"


def _check_kind(folder: Path, kind: Kind) -> None:
    for other in KINDS:
        if other is not kind and (folder / other.file).exists():
            raise InvalidInput(f"{folder} holds {other.unit} of another study; {kind.unit} need another --out")


def _journal(folder: Path) -> Journal:
    if folder.is_file():
        raise InvalidInput(f"{folder} is a file, --out wants a folder")
    try:
        return Journal(folder / JOURNAL)
    except OSError as error:
        raise InvalidInput(f"cannot write results to {folder}: {error.strerror}") from error


def _say_what_is_found(configs: Sequence[Task], journal: Journal, folder: Path, unit: str) -> None:
    """One line when tasks will not be played again, or others share the journal."""
    found = sum(config.digest() in journal for config in configs)
    others = len(journal) - found
    if found or others:
        rest = f"; {others} of other options or code stay in its journal" if others else ""
        print(f"{found} of {len(configs)} {unit} found in {folder}{rest}", file=sys.stderr)
