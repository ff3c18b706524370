"""`care-sim benchmark`: the official suite, one result file for every policy."""

import re
import sys
from collections.abc import Sequence
from pathlib import Path

from care_sim.base.errors import InvalidInput, print_lines, report_problems
from care_sim.base.files import JSON, check_output
from care_sim.base.interrupts import DONE, FAILED
from care_sim.commands.options.results import B90, Benchmark
from care_sim.commands.shared.console import TableConsole
from care_sim.commands.shared.entries import entries_of
from care_sim.commands.shared.selection import check_values
from care_sim.policies.isolation import isolated_policies
from care_sim.reports.budgets import budget_tables
from care_sim.reports.figures.budgets import BUDGETS_FIGURE, budgets_figure
from care_sim.reports.figures.styles import check_figure, save
from care_sim.reports.leaderboard import leaderboard_table
from care_sim.reports.recorded import sources_table
from care_sim.study.benchmark.budgets import (
    MAIN_DETECTOR,
    BudgetResult,
    budget_tasks,
    budget_worlds,
    play_budgets,
    references,
)
from care_sim.study.benchmark.play import played, player_in, screened_worlds
from care_sim.study.benchmark.recorded import recorded_drives
from care_sim.study.benchmark.suite import (
    Entry,
    Salt,
    World,
    published_worlds,
    quick_tenth,
    tasks_of,
)
from care_sim.study.executors import processes
from care_sim.study.run_config import RunConfig
from care_sim.study.runner import by_reason


@isolated_policies()
def benchmark(options: Benchmark) -> int:
    """Play the official suite and write a result file per policy."""
    check_values(options, "policy")
    if options.score == B90:
        return _smallest_budgets(options)
    if options.quick and options.sealed:
        raise InvalidInput("a sealed set is played whole: give either quick or sealed")
    if options.sealed and options.out == Benchmark.out:
        raise InvalidInput(
            f"a sealed set leaves its seeds in the folder: give --out one that only you read, "
            f"not {Benchmark.out}"
        )
    salt = Salt.read(options.sealed) if options.sealed else None
    # One world of every part is enough to see whether a policy can be made.
    tried = [*{world.part: world for world in published_worlds()}.values()]
    entries, left_out = entries_of(
        options, lambda entry: [task.config for task in tasks_of(entry, tried)]
    )
    kind = ".quick" if options.quick else ".sealed" if options.sealed else ""
    files = {entry: _file(options, entry, kind) for entry in entries}
    for path in files.values():
        check_output(path, JSON)
    print_lines(f"Results go to {options.out}", file=sys.stderr)
    with player_in(options.out, options.workers, processes) as player:
        worlds = screened_worlds(player, salt) if salt else _published(options)
        results = played(entries, worlds, player, options.quick, salt.digest if salt else None)
    for result in results:
        result.write(files[result.entry])
    if results:
        TableConsole().print(leaderboard_table(results).rich())
        print_lines(*(f"Result: {files[result.entry]}" for result in results))
    failed = [f"failed: {line}" for line in by_reason(player.failures, "plays")]
    report_problems([*failed, *left_out])
    return FAILED if failed or left_out else DONE


def _published(options: Benchmark) -> Sequence[World]:
    return quick_tenth(published_worlds()) if options.quick else published_worlds()


def _smallest_budgets(options: Benchmark) -> int:
    """Play the budgets, write a result file per policy, a table and a figure."""
    detector = options.detector or MAIN_DETECTOR
    drives = recorded_drives(options.recorded)
    worlds = budget_worlds(options.quick, options.closed_loop, drives, options.without_streets)
    marks = {
        "quick": options.quick,
        "closed-loop": options.closed_loop,
        "recorded": options.recorded,
        "without-streets": options.without_streets,
    }
    kind = ".".join([detector, *(name for name, on in marks.items() if on)])
    figure = options.out / f"{BUDGETS_FIGURE}.{kind}"

    def first_tasks(entry: Entry) -> Sequence[RunConfig]:
        return [
            budget_tasks(entry, part, seeds[:1], detector)[0][-1] for part, seeds in worlds.items()
        ]

    entries, left_out = entries_of(options, first_tasks)
    files = {entry: _file(options, entry, f".b90.{kind}") for entry in entries}
    for path in files.values():
        check_output(path, JSON)
    check_figure(figure)
    print_lines(f"Results go to {options.out}", file=sys.stderr)
    with player_in(options.out, options.workers, processes) as player:
        results = play_budgets(entries, player, detector, worlds, options.quick)
    for result in results:
        result.write(files[result.entry])
    if results:
        shown = _with_references(results)
        save(budgets_figure(shown), figure)
        sources = [sources_table(shown)] if drives else []
        TableConsole().print(*(table.rich() for table in [*budget_tables(shown), *sources]))
        print_lines(*(f"Result: {files[result.entry]}" for result in results))
        print_lines(f"Figure: {figure}.svg")
    failed = [f"failed: {line}" for line in by_reason(player.failures, "plays")]
    report_problems([*failed, *left_out])
    return FAILED if failed or left_out else DONE


def _with_references(results: Sequence[BudgetResult]) -> list[BudgetResult]:
    """Return the results with the other published entries in the same worlds."""
    own = {result.entry.full_name for result in results}
    published = references(results[0].detector, results[0].worlds)
    return [*results, *(each for each in published if each.entry.full_name not in own)]


def _file(options: Benchmark, entry: Entry, kind: str) -> Path:
    """Return the result file of an entry; `kind` marks trials and other scores."""
    name = re.sub(r"[^\w.=-]+", "-", entry.full_name)
    return options.out / f"{name}{kind}.json"
