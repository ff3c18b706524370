"""The table of B90: how few cells each entry needs, and which count holds it back."""

from collections import Counter
from collections.abc import Sequence
from math import isinf

from care_sim.base.errors import counted
from care_sim.evaluation.smallest_budget import (
    BUDGETS,
    ENOUGH,
    budget_ratio,
    names_of,
    ratio_interval,
    reaching,
)
from care_sim.reports.formatting import MARKS, marked, tag_notes
from care_sim.reports.table import Bold, Table, TableRow
from care_sim.study.benchmark.budgets import BudgetResult
from care_sim.study.benchmark.result import is_fresh
from care_sim.study.run_config import FULL

YARDSTICK = "care-sector"
"""The entry by whose B90 those of all others are divided."""
_NOTES = (
    f"Cells needed for {ENOUGH:.0%} of what a full scan has, in % of all cells; B90 is for all "
    "counts. Intervals are over worlds.",
    "Tied entries share ranks, such as 1-3: the interval of their paired ratio includes 1.",
)
_TIMED = "ms: p50 / p99 of a decision of the policy on streets, on the machine of its file."
_TRIAL = "A trial on the streets that --quick plays."


def budgets_table(results: Sequence[BudgetResult]) -> Table:
    """Return a table with a line per result, the smallest B90 first.

    A line has the rank, what each count alone needs, the ratio to `YARDSTICK` and the time of a
    decision, where results have these. All results must be of the same worlds.
    """
    yardstick = next((each for each in results if each.entry.name == YARDSTICK), None)
    is_timed = any(each.policy_ms for each in results)
    ordered = sorted_by_budget(results)
    ranks = _ranks(ordered)
    rows: list[TableRow] = []
    for name, each in zip(names_in(ordered), ordered, strict=True):
        budget, low, high = map(format_budget, each.score[:3])
        rows.append(
            (
                ranks.get(id(each), ""),
                name,
                f"{budget} [{low}, {high}]",
                each.score.held_back_by,
                *map(format_budget, reaching(each.counts)),
                *([] if yardstick is None else [_ratio(each, yardstick)]),
                *([" / ".join(f"{value:.1f}" for value in each.policy_ms)] if is_timed else []),
            )
        )
    last = () if yardstick is None else (f"times {YARDSTICK}",)
    columns = ("rank", "policy", "B90", "held back by", *names_of(results[0].counts), *last)
    notes = (*_NOTES, *((_TIMED,) if is_timed else ()))
    notes += (_TRIAL,) if any(each.quick for each in results) else ()
    return Table(
        f"How few cells are enough: B90, {_worlds(results[0])}, {results[0].detector}",
        (*columns, *(("ms",) if is_timed else ())),
        tuple(rows),
        (*notes, *tag_notes(each.tags for each in results)),
        whole=("rank", "B90"),
        names=2,
    )


def sorted_by_budget(results: Sequence[BudgetResult]) -> list[BudgetResult]:
    """Sort results by B90, the smallest first; equal ones keep their order."""
    return sorted(results, key=lambda result: result.score.budget)


def names_in(results: Sequence[BudgetResult]) -> list[str]:
    """Return the name of each, with a mark if no car can have it, and with the start of the hash of
    its code if several have the name.
    """
    times = Counter(each.entry.name for each in results)
    names = (
        f"{each.entry.name} #{str(each.made_by.get('policy_code', ''))[:7]}"
        if times[each.entry.name] > 1
        else each.entry.name
        for each in results
    )
    return [marked(name, each.tags) for name, each in zip(names, results, strict=True)]


def _ranks(ordered: Sequence[BudgetResult]) -> dict[int, str]:
    """Return the interval of ranks by `id` of every result that a car can have."""
    ranked = [each for each in ordered if not {*each.tags} & {*MARKS} and each.entry.policy != FULL]
    ranks = {}
    for each in ranked:
        ratios = [ratio_interval(each.draws, other.draws) for other in ranked]
        first = 1 + sum(low > 1 for low, _ in ratios)
        last = len(ranked) - sum(high < 1 for _, high in ratios)
        ranks[id(each)] = f"{first}" if first == last else f"{first}-{last}"
    return ranks


def _worlds(result: BudgetResult) -> str:
    kind = f" sealed by {result.sealed[:12]}" if result.sealed else ""
    fresh = "fresh " if not kind and is_fresh(result) else ""
    return f"{counted(len(result.rows), f'{fresh}world')}{kind}"


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
