"""A study from configurations to a folder of results, and a report of what lies in one."""

import json
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from care_sim.errors import InvalidInput
from care_sim.study.annotation import annotated
from care_sim.study.config import EpisodeConfig, without_seeds
from care_sim.study.episode import Row
from care_sim.study.executors import ExecutorFactory, processes
from care_sim.study.figures import remove_others, save
from care_sim.study.journal import Journal
from care_sim.study.latex import PREAMBLE, latex, paragraph
from care_sim.study.progress import run_with_progress
from care_sim.study.provenance import machine, versions
from care_sim.study.rows import write_rows
from care_sim.study.runner import Failure
from care_sim.study.studies import STUDIES, SWEEP, Study

ROWS = "episodes.parquet"
JOURNAL = "journal.jsonl"


def conduct(
    configs: Sequence[EpisodeConfig],
    folder: Path,
    workers: int,
    make_executor: ExecutorFactory = processes,
    study: Study = SWEEP,
) -> list[Failure]:
    """Run a study into `folder`, going on where an earlier run stopped; returns the episodes that failed.

    Writes `journal.jsonl` as episodes finish; then, if there are any, `config.json` with the configurations and what
    failed, `episodes.parquet` with the rows of `configs` in their order and the columns of
    `care_sim.study.annotation`, `tables.md`, `tables.tex` and the figures of `study`.
    Raises InvalidInput for no episode or no worker, and when the folder cannot be written.
    """
    if not configs:
        raise InvalidInput("a study needs at least one value on every axis")
    if workers < 1:
        raise InvalidInput(f"workers must be a whole number >= 1, got {workers}")
    with _journal(folder) as journal:
        _say_what_is_found(configs, journal, folder)
        failures = run_with_progress(configs, journal, workers, make_executor)
        rows = [journal[digest] for digest in (config.digest() for config in configs) if digest in journal]
    if rows:
        rows = annotated(rows)
        (folder / "config.json").write_text(_description(configs, study, failures))
        write_rows(rows, folder / ROWS, study.name)
        write_report(rows, folder, study)
    return failures


def write_report(rows: Sequence[Row], folder: Path, study: Study = SWEEP) -> None:
    """Write tables and figures into a folder; figures of an earlier study are removed."""
    tables, closing = study.tables(rows), study.closing(rows)
    statements = "## Statements\n\n" + "".join(f"- {sentence}\n" for sentence in closing)
    pages = [f"{study.caption}\n", *(table.markdown() for table in tables), statements]
    (folder / "tables.md").write_text("\n".join(pages))
    texts = [paragraph(study.caption), *map(latex, tables), *map(paragraph, closing)]
    (folder / "tables.tex").write_text("\n".join([PREAMBLE, *texts]))
    figures = study.figures(rows)
    remove_others(folder, (name for known in STUDIES.values() for name in known.figure_names), figures)
    for name, figure in figures.items():
        save(figure, folder / name)


def print_report(rows: Sequence[Row], console: Console, study: Study = SWEEP) -> None:
    """Print the tables, how to read them, and the closing sentences."""
    for table in study.tables(rows):
        if table.terminal:
            console.print(table.rich())
            console.print()
    for sentence in (study.caption, *study.closing(rows)):
        console.print(sentence, markup=False)


def _description(configs: Sequence[EpisodeConfig], study: Study, failures: Sequence[Failure]) -> str:
    settings = {"study": study.name, "versions": versions(), "machine": machine(), "failed": [*map(str, failures)]}
    return json.dumps(settings | {"configurations": without_seeds(configs)}, indent=1) + "\n"


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
