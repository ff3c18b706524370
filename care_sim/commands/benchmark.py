"""`care-sim benchmark`: B90 of policies, a result file per entry."""

import re
import sys
from collections.abc import Sequence
from pathlib import Path

from care_sim.base.errors import print_lines, report_problems
from care_sim.base.files import JSON, check_output
from care_sim.base.interrupts import DONE, FAILED
from care_sim.commands.options.results import Benchmark
from care_sim.commands.shared.console import TableConsole
from care_sim.commands.shared.entries import entries_of
from care_sim.commands.shared.selection import check_values
from care_sim.policies.isolation import isolated_policies
from care_sim.reports.budgets import budget_tables
from care_sim.reports.figures.budgets import BUDGETS_FIGURE, budgets_figure
from care_sim.reports.figures.styles import check_figure, save
from care_sim.reports.recorded import sources_table
from care_sim.study.benchmark.budgets import budget_tasks, budget_worlds, play_budgets
from care_sim.study.benchmark.play import player_in
from care_sim.study.benchmark.recorded import RecordedDrive, recorded_drives
from care_sim.study.benchmark.result import with_references
from care_sim.study.benchmark.suite import STREETS, Entry, Salt, fresh_seeds
from care_sim.study.executors import processes
from care_sim.study.rows.parameters import parameters
from care_sim.study.run_config import RunConfig
from care_sim.study.runner import by_reason


@isolated_policies()
def benchmark(options: Benchmark) -> int:
    """Play all budgets; write a result file per policy, a table and a figure."""
    check_values(options, "policy")
    salt = Salt.read(options.sealed) if options.sealed else None
    drives = recorded_drives(options.recorded)
    looking = parameters(options.detector_parameters)
    published = budget_worlds(options.quick, options.closed_loop, drives, options.without_streets)

    def first_tasks(entry: Entry) -> Sequence[RunConfig]:
        # One world of every part is enough to see whether a policy can be made.
        return [
            budget_tasks(entry, part, own[:1], options.detector, looking)[0][-1]
            for part, own in published.items()
        ]

    entries, left_out = entries_of(options, first_tasks)
    kind = _kind(options, drives, salt)
    figure = options.out / f"{BUDGETS_FIGURE}.{kind}"
    files = {entry: _file(options, entry, kind) for entry in entries}
    for path in files.values():
        check_output(path, JSON)
    check_figure(figure)
    print_lines(f"Results go to {options.out}", file=sys.stderr)
    worlds = published
    if options.fresh:
        worlds = {STREETS: fresh_seeds(options.out, options.fresh)}
    elif salt:
        # Sealed worlds are numbers, from which the salt draws seeds.
        worlds = {STREETS: range(len(published[STREETS]))}
    with player_in(options.out, options.workers, processes) as player:
        results = play_budgets(
            entries, player, options.detector, worlds, options.quick, salt, looking
        )
    for result in results:
        result.write(files[result.entry])
    if results:
        shown = with_references(results)
        save(budgets_figure(shown), figure)
        sources = [sources_table(shown)] if drives else []
        TableConsole().print(*(table.rich() for table in [*budget_tables(shown), *sources]))
        print_lines(*(f"Result: {files[result.entry]}" for result in results))
        print_lines(f"Figure: {figure}.svg")
    failed = [f"failed: {line}" for line in by_reason(player.failures, "plays")]
    report_problems([*failed, *left_out])
    return FAILED if failed or left_out else DONE


def _kind(options: Benchmark, drives: Sequence[RecordedDrive], salt: Salt | None) -> str:
    """Return what the names of files say of the worlds."""
    sources = dict.fromkeys(drive.source.kind for drive in drives)
    marks = {
        "quick": options.quick,
        "closed-loop": options.closed_loop,
        "-".join(["recorded", *sources]): drives,
        "without-streets": options.without_streets,
        f"fresh-{options.fresh}": options.fresh,
        f"sealed-{salt.digest[:8] if salt else ''}": salt,
    }
    own = "-".join([options.detector, *options.detector_parameters])
    return ".".join([re.sub(r"[^\w.=-]+", "-", own), *(name for name, on in marks.items() if on)])


def _file(options: Benchmark, entry: Entry, kind: str) -> Path:
    name = re.sub(r"[^\w.=-]+", "-", entry.full_name)
    return options.out / f"{name}.{kind}.json"
