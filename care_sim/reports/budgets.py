"""The tables of B90: how few cells each entry needs, and which count holds it back."""

from collections.abc import Callable, Sequence
from math import isinf

from care_sim.base.errors import counted
from care_sim.evaluation.smallest_budget import (
    BUDGETS,
    ENOUGH,
    LEAST_WORLDS,
    budget_ratio,
    has_interval,
    names_of,
    reaching,
)
from care_sim.reports.formatting import MARKS, marked, tag_notes
from care_sim.reports.table import Bold, Table, TableRow
from care_sim.study.benchmark.budgets import BudgetResult
from care_sim.study.run_config import FULL

YARDSTICK = "care-sector"
"""The entry by whose B90 those of all others are divided."""
NOTE = (
    f"Cells needed for {ENOUGH:.0%} of what a full scan has, in % of all cells; B90 is for all "
    "counts."
)
"""What the numbers are."""
_INTERVALS = "Intervals are over worlds."
_NO_INTERVAL = f"Fewer than {LEAST_WORLDS} worlds carry no interval."
_TRIAL = "A trial on the streets that --quick plays."


def budget_tables(results: Sequence[BudgetResult], by: str = YARDSTICK) -> list[Table]:
    """Return the tables of results of the same worlds: of several parts one of all parts side by
    side, and then the counts of every part.
    """
    parts = results[0].parts
    if len(parts) == 1:
        return [budgets_table(results, by)]
    each = [budgets_table([one.of_part(part) for one in results], by) for part in parts]
    return [parts_table(results, by), *each]


def budgets_table(results: Sequence[BudgetResult], by: str = YARDSTICK) -> Table:
    """Return a table with a line per result, the smallest B90 first.

    A line has what each count alone needs, and the ratio to the entry `by` where that entry is
    there. All results must be of the same worlds.
    """

    def cells(one: BudgetResult) -> TableRow:
        return one.score.held_back_by, *map(format_budget, reaching(one.counts))

    return _table(results, by, ("held back by", *names_of(results[0].counts)), cells)


def parts_table(results: Sequence[BudgetResult], by: str = YARDSTICK) -> Table:
    """Return a table as `budgets_table` does, with B90 of every part alone in place of the
    counts.
    """

    def cells(one: BudgetResult) -> TableRow:
        alone = {part: one.of_part(part) for part in one.parts}
        worst = max(alone, key=lambda part: alone[part].score.budget)
        last = f"{worst}: {alone[worst].score.held_back_by}"
        return last, *(format_smallest(own) for own in alone.values())

    return _table(results, by, ("held back by", *results[0].parts), cells)


def _table(
    results: Sequence[BudgetResult],
    by: str,
    columns: TableRow,
    cells: Callable[[BudgetResult], TableRow],
) -> Table:
    yardstick = next((each for each in results if each.entry.name == by), None)
    rows: list[TableRow] = []
    place = 0
    for each in sorted_by_budget(results):
        is_beyond = bool({*each.tags} & {*MARKS}) or each.entry.policy == FULL
        place += not is_beyond
        ratio = (
            []
            if yardstick is None
            else ["" if each is yardstick else format_ratio(each, yardstick)]
        )
        rows.append(
            (
                "" if is_beyond else f"{place}",
                marked(each.entry.name, each.tags),
                format_smallest(each),
                *cells(each),
                *ratio,
            )
        )
    last = () if yardstick is None else (f"times {by}",)
    return Table(
        f"How few cells are enough: B90, {_worlds(results[0])}, {results[0].detector}",
        ("", "policy", "B90", *columns, *last),
        tuple(rows),
        (*_notes(results), *tag_notes(each.tags for each in results)),
        whole=("", "B90"),
        names=2,
    )


def _worlds(result: BudgetResult) -> str:
    """Return the number of worlds, and of which parts they are."""
    sizes = [f"{part} {len(result.of_part(part).rows)}" for part in result.parts]
    parts = f" ({', '.join(sizes)})" if len(sizes) > 1 else f" ({result.parts[0]})"
    return f"{counted(len(result.rows), 'world')}{parts}"


def _notes(results: Sequence[BudgetResult]) -> tuple[str, ...]:
    intervals = _INTERVALS if has_interval(results[0].counts) else _NO_INTERVAL
    return f"{NOTE} {intervals}", *((_TRIAL,) if any(each.quick for each in results) else ())


def sorted_by_budget(results: Sequence[BudgetResult]) -> list[BudgetResult]:
    """Sort results by B90, the smallest first; equal ones keep their order."""
    return sorted(results, key=lambda result: float(reaching(result.counts).max()))


def format_smallest(result: BudgetResult) -> str:
    """Format B90 of a result, with its interval where there are worlds enough for one."""
    budget, low, high = map(format_budget, result.score[:3])
    return f"{budget} [{low}, {high}]" if has_interval(result.counts) else budget


def format_budget(budget: float) -> str:
    """Format a budget in percent of the cells, with ≤ at the smallest one; "never" if infinite."""
    if isinf(budget):
        return "never"
    return f"≤{100 * budget:.1f}" if budget <= BUDGETS[0] else f"{100 * budget:.1f}"


def format_ratio(ours: BudgetResult, theirs: BudgetResult) -> str:
    """Format the ratio of two B90 with its interval, bold where the interval excludes 1."""
    if all(isinf(one.score.budget) for one in (ours, theirs)):
        return "both never"
    mean, low, high = budget_ratio(ours.counts, theirs.counts)
    if (isinf(mean) and isinf(low)) or not has_interval(ours.counts):
        return "never" if isinf(mean) else f"{mean:.2f}"
    if isinf(mean):
        return f"never [{low:.2f}, never]"
    text = f"{mean:.2f} [{low:.2f}, {'never' if isinf(high) else f'{high:.2f}'}]"
    return Bold(text) if low > 1 or high < 1 else text
