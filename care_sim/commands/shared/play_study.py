"""How a command plays a study: over workers, into a folder, and naming what is left out."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from care_sim.base.console import TableConsole
from care_sim.base.errors import print_lines, report_problems
from care_sim.base.exit_codes import DONE, FAILED
from care_sim.commands.options.shared import StudyOptions
from care_sim.commands.shared.command_line import command_line
from care_sim.commands.shared.folder_checks import free_folder
from care_sim.commands.shared.run_study import run_study, summary
from care_sim.reports.report import next_steps, print_report, read_results
from care_sim.reports.studies import STUDIES
from care_sim.study import executors
from care_sim.study.run_config import RunConfig


def folder_of(options: StudyOptions, study: str, configs: Sequence[RunConfig], name: str) -> Path:
    """Where the results of the tasks go: in runs/ under `name` unless the options say so."""
    if options.out is not None:
        return options.out
    return Path("runs", name) if options.force else free_folder(name, configs, STUDIES[study])


def play_study(
    options: StudyOptions,
    study: str,
    configs: Sequence[RunConfig],
    name: str,
    left_out: Sequence[str] = (),
) -> int:
    """Play the tasks and print their tables, the tasks that failed and the policies that were left
    out; returns the exit code.
    """
    make_executor = executors.cluster(options.cluster) if options.cluster else executors.processes
    out = folder_of(options, study, configs, name)
    again = command_line(replace(options, out=out))
    failures = run_study(
        configs, out, options.workers, make_executor, STUDIES[study], options.force, again
    )
    # What is printed is read back from the folder, as `care-sim report` would print it.
    if len(failures) < len(configs):
        rows, _, missing = read_results(out)
        print_report(rows, TableConsole(), STUDIES[study], missing, verbose=options.verbose)
        print_lines(*next_steps(out, STUDIES[study], rows))
    unit = STUDIES[study].results.unit
    report_problems([*(f"failed: {line}" for line in summary(failures, unit)), *left_out])
    return FAILED if failures or left_out else DONE
