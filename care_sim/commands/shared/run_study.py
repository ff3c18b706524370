"""A study, from its configurations to a folder of results."""

import json
import re
import shlex
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from care_sim.base.checks import check_whole
from care_sim.base.errors import InvalidInput, counted, print_lines, report_problems
from care_sim.base.files import write_text
from care_sim.base.interrupts import DONE, FAILED
from care_sim.commands.options.shared import StudyOptions
from care_sim.commands.shared.command_line import command_line
from care_sim.commands.shared.console import TableConsole
from care_sim.commands.shared.folder_checks import check_folder, free_folder, lost
from care_sim.reports.report import (
    CONFIG,
    TABLES,
    StudyReport,
    next_steps,
    print_report,
    read_results,
)
from care_sim.reports.studies import STUDIES, SWEEP, study_of
from care_sim.reports.study import Study
from care_sim.study import executors
from care_sim.study.executors import ExecutorFactory, processes
from care_sim.study.journal import JOURNAL, UNFINISHED, Journal, forget, note_begin
from care_sim.study.progress import run_with_progress
from care_sim.study.provenance import code_digest, machine, versions
from care_sim.study.rows.checks import check_worlds
from care_sim.study.rows.parquet import (
    check_columns,
    read_table,
    write_columns,
    write_rows,
)
from care_sim.study.run_config import Row, RunConfig
from care_sim.study.runner import Failure, by_reason


def play_study(
    options: StudyOptions,
    name: str,
    configs: Sequence[RunConfig],
    folder: str,
    left_out: Sequence[str] = (),
) -> int:
    """Play the tasks of the study `name` and return the exit code. Results go to runs/ under
    `folder`, unless the options say otherwise. Prints tables, failed tasks and policies that were
    left out.
    """
    study = STUDIES[name]
    # A refusal by environment or policy comes once, before anything is played; weights may be of
    # one budget.
    for config in {(each.policy, each.budget): each for each in configs}.values():
        config.try_out()
    make_executor = executors.cluster(options.cluster) if options.cluster else executors.processes
    usual = Path("runs", folder) if options.force else None
    out = options.out or usual or free_folder(folder, configs, study)
    again = command_line(replace(options, out=out))
    failures = run_study(configs, out, options.workers, make_executor, study, options.force, again)
    # Read the rows back from the folder, as `care-sim report` would print them.
    if len(failures) < len(configs):
        rows, _, missing = read_results(out)
        print_report(rows, TableConsole(), study, missing, verbose=options.verbose)
        print_lines(*next_steps(out, study, rows))
    lines = [f"failed: {line}" for line in by_reason(failures, study.results.unit)]
    report_problems([*lines, *left_out])
    return FAILED if failures or left_out else DONE


_MANY = 1000
"""Rows whose tables and figures take more than a second."""


def run_study(
    configs: Sequence[RunConfig],
    folder: Path,
    workers: int,
    make_executor: ExecutorFactory = processes,
    study: Study = SWEEP,
    force: bool = False,
    command: str = "",
) -> list[Failure]:
    """Run a study into `folder`, going on where an earlier run stopped; returns the tasks that
    failed.

    Names the folder, and leaves in it how large the study is and the `command` that plays it, until
    it has ended (`care_sim.study.journal`). Writes `journal.jsonl` as tasks finish, and when all
    have ended and some did not fail, the results: `config.json`, Parquet files, tables and figures
    of `study`. No other study can take the folder until then. A folder that holds all of it
    stays as it is, unless `force`; `report` draws lost figures. Where the folder holds rows
    that were not obtained again because tasks failed, its files stay, unless `force`.

    Raises InvalidInput for no task or no worker, when the folder cannot be written, where a
    scenario builds different worlds of one seed, and where `check_folder` does.
    """
    if not configs:
        raise InvalidInput("a study needs at least one value on every axis")
    check_whole("workers", workers, 1)
    # The keys are of the code as it is when this run begins. The code is hashed once for all tasks.
    code = code_digest()
    configs = [config.changed(key=config.digest(code)) for config in configs]
    kind = study.results
    goes = f"Results go to {folder}: {counted(len(configs), kind.task)}"
    if not force and _is_finished(configs, folder, study):
        everything = f"{len(configs)} of {len(configs)} {kind.unit}"
        print_lines(goes, f"{everything} found in {folder}", file=sys.stderr)
        return []
    check_columns(config.row() for config in configs)
    # The folder is checked before it is locked, which would leave a file in it, and again after, in
    # case that another process has written meanwhile.
    check_folder(folder, configs, study, force=force)
    with _journal(folder, study) as journal:
        check_folder(folder, configs, study, journal, force)
        print_lines(goes, file=sys.stderr)
        others = _report_found(configs, journal, folder, kind.unit)
        note_begin(folder, study.name, counted(len(configs), kind.task), others, command)

        # The journal keeps what finishes, even if this process ends before results are written.
        failures = run_with_progress(configs, journal, workers, make_executor, kind)
        played = [config for config in configs if config.key in journal]
        rows = [journal[config.key] for config in played]
        check_worlds(rows)

        # Results of an earlier run are worth more than new ones with holes in their place.
        if failures and not force and (left := lost(folder, played, study)):
            print_lines(left, file=sys.stderr)
        elif played:
            _write(rows, configs, folder, study, failures, command)
            forget(folder)
    return failures


def _shareable(command: str) -> str:
    """A command without what only this machine knows: where results go and recordings lie."""
    words = shlex.split(command)
    if "--out" in words:
        at = words.index("--out")
        del words[at : at + 2]
    if "--source" in words:
        at = words.index("--source") + 1
        words[at] = re.sub(":.*", ":FOLDER", words[at])
    return shlex.join(words)


def _journal(folder: Path, study: Study) -> Journal:
    if folder.is_file():
        raise InvalidInput(f"{folder} is a file, --out wants a folder")
    try:
        return Journal(folder / JOURNAL, study.name)
    except OSError as error:
        raise InvalidInput(f"cannot write results to {folder}: {error.strerror}") from error


def _report_found(configs: Sequence[RunConfig], journal: Journal, folder: Path, unit: str) -> int:
    """Print one line when the journal holds tasks of this study or of others, and one for lines of
    it that are damaged; returns how many of others it holds.
    """
    if journal.damaged:
        lines = counted(journal.damaged, "line")
        print_lines(
            f"{lines} of {folder / JOURNAL} passed over, damaged or of a version "
            "that wrote no checksums; what they held is played again where it is asked for",
            file=sys.stderr,
        )
    found = sum(config.key in journal for config in configs)
    others = len(journal) - found
    if found or others:
        rest = f"; {others} of other options or code stay in its journal" if others else ""
        print_lines(f"{found} of {len(configs)} {unit} found in {folder}{rest}", file=sys.stderr)
    return others


def _is_finished(configs: Sequence[RunConfig], folder: Path, study: Study) -> bool:
    """Check if an earlier run wrote the results of exactly these tasks, and no file but a figure is
    lost. The journal, which takes longer to read, is then not needed.
    """
    kind = study.results
    path = folder / kind.file
    # A run that was cut off while it wrote has left its note.
    names = (CONFIG, TABLES, "tables.tex", kind.file, JOURNAL, *kind.further_files([]))
    if (folder / UNFINISHED).is_file() or not all((folder / name).is_file() for name in names):
        return False
    table = read_table(path)
    if study_of(path) is not study or "digest" not in table.column_names:
        return False
    return bool(table["digest"].to_pylist() == [config.key for config in configs])


def _write(
    rows: Sequence[Row],
    configs: Sequence[RunConfig],
    folder: Path,
    study: Study,
    failures: Sequence[Failure],
    command: str,
) -> None:
    """Write the results of a study: everything is made before the first file is replaced."""
    kind = study.results
    left_out = by_reason(failures, kind.unit)
    if len(rows) >= _MANY:
        print(f"making tables and figures of {counted(len(rows), kind.task)}", file=sys.stderr)
    kept = kind.kept_rows(rows)
    further = kind.further_files(rows)
    report = StudyReport.of(kept, study, left_out)
    settings = {
        "study": study.name,
        "command": _shareable(command),
        "versions": versions(),
        "machine": machine(),
        "failed": [*map(str, failures)],
    }
    # A line per configuration: one value a line makes megabytes of a study with thousands.
    listed = kind.listed(configs)
    lines = ",\n".join(f"  {json.dumps(own)}" for own in listed.pop("configurations"))
    head = json.dumps(settings | listed, indent=1).removesuffix("\n}")
    write_text(folder / CONFIG, f'{head},\n "configurations": [\n{lines}\n ]\n}}\n')
    for name, columns in further.items():
        write_columns(columns, folder / name)
    write_rows(kept, folder / kind.file, study.name, left_out, study.schema)
    report.write(folder)
