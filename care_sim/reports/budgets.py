"""The table of B90: how few cells each entry needs, and which count holds it back."""

from collections.abc import Sequence
from math import isinf

from care_sim.base.errors import counted
from care_sim.evaluation.smallest_budget import (
    BUDGETS,
    ENOUGH,
    budget_ratio,
    names_of,
    reaching,
)
from care_sim.reports.formatting import MARKS, marked, tag_notes
from care_sim.reports.table import Bold, Table, TableRow
from care_sim.study.benchmark.budgets import BudgetResult
from care_sim.study.run_config import FULL

YARDSTICK = "care-sector"
"""The entry by whose B90 those of all others are divided."""
_NOTE = (
    f"Cells needed for {ENOUGH:.0%} of what a full scan has, in % of all cells; B90 is for all "
    "counts. Intervals are over worlds."
)
_TRIAL = "A trial on the streets that --quick plays."


def budgets_table(results: Sequence[BudgetResult], by: str = YARDSTICK) -> Table:
    """Return a table with a line per result, the smallest B90 first.

    A line has what each count alone needs, and the ratio to the entry `by` where that entry is
    there. All results must be of the same worlds.
    """
    yardstick = next((each for each in results if each.entry.name == by), None)
    rows: list[TableRow] = []
    place = 0
    for each in sorted_by_budget(results):
        is_beyond = bool({*each.tags} & {*MARKS}) or each.entry.policy == FULL
        place += not is_beyond
        score = each.score
        budget, low, high = map(format_budget, score[:3])
        ratio = [] if yardstick is None else [_ratio(each, yardstick)]
        rows.append(
            (
                "" if is_beyond else f"{place}",
                marked(each.entry.name, each.tags),
                f"{budget} [{low}, {high}]",
                score.held_back_by,
                *map(format_budget, reaching(each.counts)),
                *ratio,
            )
        )
    last = () if yardstick is None else (f"times {by}",)
    columns = ("", "policy", "B90", "held back by", *names_of(results[0].counts), *last)
    worlds = f"{counted(len(results[0].rows), 'world')}, {results[0].detector}"
    notes = (_NOTE, *((_TRIAL,) if any(each.quick for each in results) else ()))
    return Table(
        f"How few cells are enough: B90, {worlds}",
        columns,
        tuple(rows),
        (*notes, *tag_notes(each.tags for each in results)),
        whole=("", "B90"),
        names=2,
    )


def sorted_by_budget(results: Sequence[BudgetResult]) -> list[BudgetResult]:
    """Sort results by B90, the smallest first; equal ones keep their order."""
    return sorted(results, key=lambda result: float(reaching(result.counts).max()))


def format_budget(budget: float) -> str:
    """Format a budget in percent of the cells, with ≤ at the smallest one; "never" if infinite."""
    if isinf(budget):
        return "never"
    return f"≤{100 * budget:.1f}" if budget <= BUDGETS[0] else f"{100 * budget:.1f}"


def _ratio(result: BudgetResult, yardstick: BudgetResult) -> str:
    if result is yardstick:
        return ""
    mean, low, high = budget_ratio(result.counts, yardstick.counts)
    if isinf(mean):
        return "never" if isinf(low) else f"never [{low:.2f}, never]"
    text = f"{mean:.2f} [{low:.2f}, {'never' if isinf(high) else f'{high:.2f}'}]"
    return Bold(text) if low > 1 or high < 1 else text
