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
from care_sim.commands.shared.run_study import run_study
from care_sim.reports.report import next_steps, print_report, read_results
from care_sim.reports.studies import STUDIES
from care_sim.study import executors
from care_sim.study.run_config import RunConfig
from care_sim.study.runner import by_reason


def play_study(
    options: StudyOptions,
    name: str,
    configs: Sequence[RunConfig],
    folder: str,
    left_out: Sequence[str] = (),
) -> int:
    """Play the tasks of the study `name`, in runs/ under `folder` unless the options say otherwise,
    and print their tables, the tasks that failed and the policies that were left out; returns the
    exit code.
    """
    study = STUDIES[name]
    # A condition that no environment accepts is told once, before anything is played.
    for config in configs[:1]:
        config.try_out()
    make_executor = executors.cluster(options.cluster) if options.cluster else executors.processes
    usual = Path("runs", folder) if options.force else None
    out = options.out or usual or free_folder(folder, configs, study)
    again = command_line(replace(options, out=out))
    failures = run_study(configs, out, options.workers, make_executor, study, options.force, again)
    # What is printed is read back from the folder, as `care-sim report` would print it.
    if len(failures) < len(configs):
        rows, _, missing = read_results(out)
        print_report(rows, TableConsole(), study, missing, verbose=options.verbose)
        print_lines(*next_steps(out, study, rows))
    lines = [f"failed: {line}" for line in by_reason(failures, study.results.unit)]
    report_problems([*lines, *left_out])
    return FAILED if failures or left_out else DONE
