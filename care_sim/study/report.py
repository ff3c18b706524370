"""A study from configurations to a folder of results, and a report of what lies in one."""

import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure
from rich.console import Console

from care_sim.errors import InvalidInput, check_whole
from care_sim.files import write_text
from care_sim.study.entries import counted
from care_sim.study.executors import ExecutorFactory, processes
from care_sim.study.figures import remove_others, save
from care_sim.study.journal import Journal
from care_sim.study.kinds import kind_in
from care_sim.study.latex import PREAMBLE, latex, paragraph
from care_sim.study.progress import run_with_progress
from care_sim.study.provenance import machine, versions
from care_sim.study.rows import check_columns, read_notes, read_rows, write_columns, write_rows
from care_sim.study.runner import Failure
from care_sim.study.studies import STUDIES, SWEEP, Study, study_of
from care_sim.study.table import unmarked
from care_sim.study.takeover import check_journal, check_kind, check_results, lost
from care_sim.study.task import Row, Task
from care_sim.text import printable

JOURNAL = "journal.jsonl"


def conduct(
    configs: Sequence[Task],
    folder: Path,
    workers: int,
    make_executor: ExecutorFactory = processes,
    study: Study = SWEEP,
    force: bool = False,
) -> list[Failure]:
    """Run a study into `folder`, going on where an earlier run stopped; returns the tasks that failed.

    Writes `journal.jsonl` as they finish; then, if there are any, `config.json` with the configurations and what
    failed, the Parquet files of the study's kind with the rows of `configs` in their order, `tables.md`, `tables.tex`
    and the figures of `study`; the folder is this study's until all that is written. Where tasks failed and the folder
    holds rows that were therefore not obtained, these files stay, unless `force`. Raises InvalidInput for no task
    or no worker, when the folder cannot be written, and unless `force` when it holds another study, finished or not, or
    rows of this one that are none of `configs`.
    """
    if not configs:
        raise InvalidInput("a study needs at least one value on every axis")
    check_whole("workers", workers, 1)
    configs, kind = [config.changed() for config in configs], study.kind
    check_columns(config.row() for config in configs)
    _check(folder, configs, study, force)
    with _journal(folder, study) as journal:
        _check(folder, configs, study, force, journal)
        _say_what_is_found(configs, journal, folder, kind.unit)
        failures = run_with_progress(configs, journal, workers, make_executor, kind)
        played = [config for config in configs if config.key in journal]
        left = lost(folder, played, study) if failures and not force else ""
        if left:
            print(left, file=sys.stderr)
        elif played:
            _write([journal[config.key] for config in played], configs, folder, study, failures)
    return failures


def _write(
    rows: Sequence[Row], configs: Sequence[Task], folder: Path, study: Study, failures: Sequence[Failure]
) -> None:
    """Write the results of a study: everything is made before the first file is replaced."""
    kind = study.kind
    left_out, finished, aside = summary(failures, kind.unit), kind.finish(rows), kind.aside(rows)
    report = Report.of(finished, study, left_out)
    write_text(folder / "config.json", _description(configs, study, failures))
    for name, columns in aside.items():
        write_columns(columns, folder / name)
    write_rows(finished, folder / kind.file, study.name, left_out, study.schema)
    report.write(folder)


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
    study = study_of(path)
    if study.kind is not kind:
        raise InvalidInput(f"{path} holds no rows of the study {study.name}, which are in {study.kind.file}")
    return read_rows(path, study.schema), study, read_notes(path)[1]


@dataclass(frozen=True)
class Report:
    """What a study makes of its rows: the texts of its files of tables by name, and its figures."""

    texts: Mapping[str, str]
    figures: Mapping[str, Figure]

    @classmethod
    def of(cls, rows: Sequence[Row], study: Study = SWEEP, left_out: Sequence[str] = ()) -> "Report":
        """The report of a study that lacks what is `left_out`."""
        tables, closing = study.tables(rows), _closing(rows, study, left_out)
        statements = "## Statements\n\n" + "".join(f"- {unmarked(sentence)}\n" for sentence in closing)
        pages = [f"{study.caption}\n", *(table.markdown() for table in tables), statements]
        texts = [PREAMBLE, paragraph(study.caption), *map(latex, tables), *map(paragraph, closing)]
        return cls({"tables.md": "\n".join(pages), "tables.tex": "\n".join(texts)}, study.figures(rows))

    def write(self, folder: Path) -> None:
        """Write tables and figures into a folder; then figures of an earlier study are removed."""
        for name, text in self.texts.items():
            write_text(folder / name, text)
        for name, figure in self.figures.items():
            save(figure, folder / name)
        remove_others(folder, (name for known in STUDIES.values() for name in known.figure_names), self.figures)


def write_report(rows: Sequence[Row], folder: Path, study: Study = SWEEP, left_out: Sequence[str] = ()) -> None:
    """Make a report and write it into a folder."""
    Report.of(rows, study, left_out).write(folder)


def print_report(rows: Sequence[Row], console: Console, study: Study = SWEEP, left_out: Sequence[str] = ()) -> None:
    """Print the tables, how to read them, and the closing sentences."""
    for table in study.tables(rows):
        if table.terminal:
            console.print(table.rich())
            console.print()
    for sentence in (study.caption, *_closing(rows, study, left_out)):
        console.print(sentence, markup=False)


def _closing(rows: Sequence[Row], study: Study, left_out: Sequence[str]) -> list[str]:
    return [*map(printable, [*study.closing(rows), *(f"Left out: {what}." for what in left_out)])]


def _description(configs: Sequence[Task], study: Study, failures: Sequence[Failure]) -> str:
    settings = {"study": study.name, "versions": versions(), "machine": machine(), "failed": [*map(str, failures)]}
    return json.dumps(settings | study.kind.listed(configs), indent=1) + "\n"


def _check(folder: Path, configs: Sequence[Task], study: Study, force: bool, journal: Journal | None = None) -> None:
    """Raise InvalidInput where the study may not take the folder; before it is locked, which leaves a file there, and
    after.
    """
    check_kind(folder, study)
    if not force:
        check_results(folder, configs, study)
        if journal is not None:
            check_journal(folder, configs, journal, study)


def _journal(folder: Path, study: Study) -> Journal:
    if folder.is_file():
        raise InvalidInput(f"{folder} is a file, --out wants a folder")
    try:
        return Journal(folder / JOURNAL, study.name)
    except OSError as error:
        raise InvalidInput(f"cannot write results to {folder}: {error.strerror}") from error


def _say_what_is_found(configs: Sequence[Task], journal: Journal, folder: Path, unit: str) -> None:
    """One line when tasks will not be played again, or others share the journal; one for what is damaged there."""
    if journal.damaged:
        lines = counted(journal.damaged, "line")
        print(
            f"{lines} of {folder / JOURNAL} passed over, damaged or of a version that wrote no checksums; what they "
            "held is played again where it is asked for",
            file=sys.stderr,
        )
    found = sum(config.key in journal for config in configs)
    others = len(journal) - found
    if found or others:
        rest = f"; {others} of other options or code stay in its journal" if others else ""
        print(f"{found} of {len(configs)} {unit} found in {folder}{rest}", file=sys.stderr)
