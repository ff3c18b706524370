"""A study from configurations to a folder of results, and a report of what lies in one."""

import json
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from care_sim.errors import InvalidInput
from care_sim.study.config import EpisodeConfig, without_seeds
from care_sim.study.episode import Row
from care_sim.study.executors import ExecutorFactory, processes
from care_sim.study.figures import remove_others, save, study_figures
from care_sim.study.journal import Journal
from care_sim.study.progress import run_with_progress
from care_sim.study.provenance import machine, versions
from care_sim.study.rows import write_rows
from care_sim.study.runner import Failure
from care_sim.study.statements import statements
from care_sim.study.tables import CAPTION, collision_note, study_tables

ROWS = "episodes.parquet"
JOURNAL = "journal.jsonl"


def conduct(
    configs: Sequence[EpisodeConfig], folder: Path, workers: int, make_executor: ExecutorFactory = processes
) -> list[Failure]:
    """Run a study into `folder`, going on where an earlier run stopped; returns the episodes that failed.

    Writes `journal.jsonl` as episodes finish, then `config.json`, `episodes.parquet` with the rows of
    `configs` in their order, `tables.md` and the figures. Raises InvalidInput for no episode or no worker,
    and when the folder cannot be written.
    """
    if not configs:
        raise InvalidInput("a study needs at least one value on every axis")
    if workers < 1:
        raise InvalidInput(f"workers must be a whole number >= 1, got {workers}")
    with _journal(folder) as journal:
        _say_what_is_found(configs, journal, folder)
        settings = {"versions": versions(), "machine": machine(), "configurations": without_seeds(configs)}
        (folder / "config.json").write_text(json.dumps(settings, indent=1) + "\n")
        failures = run_with_progress(configs, journal, workers, make_executor)
        rows = [journal[digest] for digest in (config.digest() for config in configs) if digest in journal]
    if rows:
        write_rows(rows, folder / ROWS)
        write_report(rows, folder)
    return failures


def write_report(rows: Sequence[Row], folder: Path) -> None:
    """Write tables and figures into a folder; figures of an earlier study are removed."""
    tables = [table.markdown() for table in study_tables(rows)]
    closing = [f"- {statement}\n" for statement in statements(rows)]
    closing_list = ["## The paper's statements\n\n" + "".join(closing)] if closing else []
    (folder / "tables.md").write_text("\n".join([f"{CAPTION}\n\n{collision_note(rows)}\n", *tables, *closing_list]))
    figures = study_figures(rows)
    remove_others(folder, figures)
    for name, figure in figures.items():
        save(figure, folder / name)


def print_report(rows: Sequence[Row], console: Console) -> None:
    """Print the tables, then the paper's statements when the rows are its study."""
    for table in study_tables(rows):
        console.print(table.rich())
        console.print()
    console.print(CAPTION, markup=False)
    console.print(collision_note(rows), markup=False)
    for statement in statements(rows):
        console.print(str(statement), markup=False)


def _journal(folder: Path) -> Journal:
    if folder.is_file():
        raise InvalidInput(f"{folder} is a file, --out wants a folder")
    try:
        return Journal(folder / JOURNAL)
    except OSError as error:
        raise InvalidInput(f"cannot write results to {folder}: {error.strerror}") from error


def _say_what_is_found(configs: Sequence[EpisodeConfig], journal: Journal, folder: Path) -> None:
    """One line when episodes will not be played again, or others share the journal."""
    found = sum(config.digest() in journal for config in configs)
    others = len(journal) - found
    if found or others:
        rest = f"; {others} of other studies stay in its journal" if others else ""
        print(f"{found} of {len(configs)} episodes found in {folder}{rest}", file=sys.stderr)
