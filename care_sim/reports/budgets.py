"""Tables of B90: how few cells each entry needs, and the count that limits it."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from math import isinf

from care_sim.base.errors import counted
from care_sim.evaluation.smallest_budget import (
    BUDGETS,
    ENOUGH,
    LEAST_WORLDS,
    budget_ratio,
    has_interval,
    names_of,
    ratio_interval,
    reaching,
)
from care_sim.reports.formatting import MARKS, marked, tag_notes
from care_sim.reports.table import Bold, Table, TableRow
from care_sim.study.benchmark.budgets import BudgetResult
from care_sim.study.benchmark.result import is_fresh
from care_sim.study.benchmark.suite import STREETS
from care_sim.study.run_config import FULL

YARDSTICK = "care-sector"
"""The entry by whose B90 those of all others are divided."""
NOTE = (
    f"Cells needed for {ENOUGH:.0%} of what a full scan has, in % of all cells; B90 is for all "
    "counts."
)
"""The note below every table of B90."""
_INTERVALS = "Intervals are over worlds."
_NO_INTERVAL = f"Fewer than {LEAST_WORLDS} worlds carry no interval."
_TIED = (
    "Rank 2-7: one entry is better, five are tied with it. Two are tied if the interval of their "
    "paired ratio includes 1."
)
_TIMED = "ms: p50 / p99 of a decision of the policy on streets, on the machine of its file."
_TRIAL = "A trial on the streets that --quick plays."


def budget_tables(results: Sequence[BudgetResult]) -> list[Table]:
    """Return the tables of results of the same worlds: of several parts one of all parts side by
    side, and then the counts of every part.
    """
    parts = results[0].parts
    if len(parts) == 1:
        return [budgets_table(results)]
    each = [budgets_table([one.of_part(part) for one in results]) for part in parts]
    return [parts_table(results), *each]


def budgets_table(results: Sequence[BudgetResult]) -> Table:
    """Return a table with a line per result, in the order of `sorted_by_budget`.

    A line has the rank, what each count alone needs, the ratio to `YARDSTICK` and the time of a
    decision, where results have these. All results must be of the same worlds.
    """

    def cells(one: BudgetResult) -> TableRow:
        return one.held_back_by, *map(format_budget, reaching(one.counts))

    return _table(results, ("held back by", *names_of(results[0].counts)), cells)


def parts_table(results: Sequence[BudgetResult]) -> Table:
    """Return a table as `budgets_table` does, with B90 of every part alone in place of the
    counts.
    """

    def cells(one: BudgetResult) -> TableRow:
        return one.held_back_by, *(format_smallest(one.of_part(part)) for part in one.parts)

    return _table(results, ("held back by", *results[0].parts), cells)


def ideas_table(whole: BudgetResult, without: Mapping[str, BudgetResult]) -> Table:
    """Return a table with a line per idea that a policy plays `without`, the one that costs most
    cells first. A line has B90, and its ratio to the `whole` policy's over all parts and on each.
    """
    dearest_first = sorted(without, key=lambda idea: -without[idea].score.budget)
    rows = [
        (
            f"without {idea}",
            format_smallest(own := without[idea]),
            own.held_back_by,
            format_ratio(own, whole),
            *(format_ratio(own.of_part(part), whole.of_part(part)) for part in whole.parts),
        )
        for idea in dearest_first
    ]
    name = whole.entry.name
    return Table(
        f"Ideas of {name}: B90 without each, {worlds_of(whole)}, {whole.detector_name}",
        ("policy", "B90", "held back by", f"times {name}", *whole.parts),
        tuple(rows),
        (f"{NOTE} Parts hold the ratio too. Bold ratios exclude 1.",),
        whole=("B90",),
    )


def _table(
    results: Sequence[BudgetResult],
    columns: TableRow,
    cells: Callable[[BudgetResult], TableRow],
) -> Table:
    # The published entry, which comes after one's own of the name.
    yardstick = next((each for each in results[::-1] if each.entry.name == YARDSTICK), None)
    is_timed = any(each.policy_ms for each in results)
    ordered = sorted_by_budget(results)
    ranks = _ranks(ordered)
    rows: list[TableRow] = []
    for name, each in zip(names_in(ordered), ordered, strict=True):
        rows.append(
            (
                ranks.get(id(each), ""),
                name,
                format_smallest(each),
                *cells(each),
                *([] if yardstick is None else [_ratio_cell(each, yardstick)]),
                *([" / ".join(f"{value:.1f}" for value in each.policy_ms)] if is_timed else []),
            )
        )
    last = () if yardstick is None else (f"times {YARDSTICK}",)
    return Table(
        f"How few cells are enough: B90, {worlds_of(results[0])}, {results[0].detector_name}",
        ("rank", "policy", "B90", *columns, *last, *(("ms",) if is_timed else ())),
        tuple(rows),
        (*_notes(results, is_timed, rows), *tag_notes(each.tags for each in results)),
        whole=("rank", "B90"),
        names=2,
    )


def _notes(results: Sequence[BudgetResult], is_timed: bool, rows: Sequence[TableRow]) -> list[str]:
    has_ranks = has_interval(results[0].counts)
    intervals = _INTERVALS if has_ranks else _NO_INTERVAL
    is_trial = STREETS in results[0].parts and any(each.quick for each in results)
    notes = {
        f"{NOTE} {intervals}": True,
        _TIED: has_ranks,
        _TIMED: is_timed,
        _TRIAL: is_trial,
    }
    # A detector that finds next to nothing makes any policy look good.
    full = (reachable(part, results[0].of_part(part)) for part in results[0].parts)
    return [*(note for note, is_due in notes.items() if is_due), *full, *least_notes(rows)]


def reachable(name: str, result: BudgetResult, kind: str = "world") -> str:
    """Return the note that says what a full scan has in the worlds of a result of one part."""
    (counts,) = result.counts
    sums = zip(counts.names, counts.full.sum(axis=0), strict=True)
    told = ", ".join(f"{value:.0f} {count}" for count, value in sums)
    return f"{name}: {counted(len(result.rows), kind)}, a full scan has {told}."


def least_notes(rows: Sequence[TableRow]) -> list[str]:
    """Return the notes that explain ≤, (+n) and 0.00, where rows of a table have them."""
    notes = {
        "≤": "≤: the smallest budget is enough.",
        "(+": "(+n): n more counts reach 90% no earlier.",
        "[0.00": "0.00: the other policy never reaches 90%.",
    }
    return [
        note for sign, note in notes.items() if any(sign in each for row in rows for each in row)
    ]


def sorted_by_budget(results: Sequence[BudgetResult]) -> list[BudgetResult]:
    """Sort results by B90, the smallest first; equal ones keep their order. Results without a rank
    come last.
    """
    return sorted(results, key=lambda result: (not _has_rank(result), result.score.budget))


def _has_rank(result: BudgetResult) -> bool:
    """Return whether a car can have the policy, and spare cells by it."""
    return not {*result.tags} & {*MARKS} and result.entry.policy != FULL


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
    """Return the interval of ranks by `id` of every result that has a rank."""
    ranked = [*filter(_has_rank, ordered)]
    ranks: dict[int, str] = {}
    if not has_interval(ordered[0].counts):
        return ranks
    for each in ranked:
        ratios = [ratio_interval(each.draws, other.draws) for other in ranked]
        first = 1 + sum(low > 1 for low, _ in ratios)
        last = len(ranked) - sum(high < 1 for _, high in ratios)
        ranks[id(each)] = f"{first}" if first == last else f"{first}-{last}"
    return ranks


def worlds_of(result: BudgetResult) -> str:
    """Return the number of worlds, and of which parts they are."""
    if result.sealed:
        return f"{counted(len(result.rows), 'world')} sealed by {result.sealed[:12]}"
    fresh = "fresh " if is_fresh(result) else ""
    sizes = [f"{part} {len(result.of_part(part).rows)}" for part in result.parts]
    parts = ", ".join(sizes) if len(sizes) > 1 else result.parts[0]
    return f"{counted(len(result.rows), f'{fresh}world')} ({parts})"


def format_smallest(result: BudgetResult) -> str:
    """Format B90 of a result, with its interval where there are worlds enough for one."""
    budget, low, high = map(format_budget, result.score)
    return f"{budget} [{low}, {high}]" if has_interval(result.counts) else budget


def format_budget(budget: float) -> str:
    """Format a budget in percent of the cells, with ≤ at the smallest one; "never" if infinite."""
    if isinf(budget):
        return "never"
    return f"≤{100 * budget:.1f}" if budget <= BUDGETS[0] else f"{100 * budget:.1f}"


def _ratio_cell(result: BudgetResult, yardstick: BudgetResult) -> str:
    return "" if result is yardstick else format_ratio(result, yardstick)


def format_ratio(ours: BudgetResult, theirs: BudgetResult) -> str:
    """Format the ratio of two B90 with its interval, bold where the interval excludes 1."""
    if all(isinf(one.score.budget) for one in (ours, theirs)):
        return "both never"
    mean, low, high = budget_ratio(ours.counts, theirs.counts)
    text = "other never" if isinf(theirs.score.budget) else _ratio_text(mean)
    if not has_interval(ours.counts):
        return text
    # An interval from "never" to "never" says no more.
    if not isinf(low) and high > 0:
        text = f"{text} [{_ratio_text(low)}, {_ratio_text(high)}]"
    return Bold(text) if low > 1 or high < 1 else text


def _ratio_text(ratio: float) -> str:
    return "never" if isinf(ratio) else f"{ratio:.2f}"
