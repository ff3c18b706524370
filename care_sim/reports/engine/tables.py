"""Tables that both loops share: one policy minus others, and policies minus the best control."""

from collections.abc import Callable, Iterable, Mapping, Sequence

from care_sim.base.errors import percent
from care_sim.reports.engine.controls import BEST_CONTROL
from care_sim.reports.engine.measures import Measure, Recall
from care_sim.reports.engine.parts import OverControl, Part
from care_sim.reports.formatting import interval
from care_sim.reports.table import Table, TableRow

PAPER = "(paper)"
"""Begin of the line under a policy that holds the paper's numbers."""
OfPaper = Callable[[Measure | Recall, str], Sequence[str]]
"""Returns the paper's claims about a policy in a measure, budget by budget; empty without any."""


def under_headings(lines: Mapping[str, Iterable[TableRow]]) -> tuple[TableRow, ...]:
    """The rows of a table, each part below its heading."""
    return tuple(line for heading, own in lines.items() for line in ((heading,), *own))


def budget_table(
    part: Part,
    title: str,
    head: str,
    lines: Iterable[TableRow],
    notes: Sequence[str] = (),
    quotes: Sequence[str] = (),
    *,
    budgets: Sequence[float] | None = None,
    terminal: bool = True,
) -> list[Table]:
    """A table of a setting with a column per budget; none without lines."""
    columns = (head, *map(percent, part.budgets if budgets is None else budgets))
    heading = f"{part.setting.label}: {title}"
    table = Table(heading, columns, tuple(lines), tuple(notes), tuple(quotes), terminal=terminal)
    return [table] if table.rows else []


def minus_tables(
    part: Part,
    base: str,
    others: Sequence[str],
    measures: Sequence[Measure | Recall],
    *,
    base_first: bool = True,
    of_paper: OfPaper = lambda measure, policy: (),
    weights: str = "",
    notes: Sequence[str] = (),
    quotes: Sequence[str] = (),
) -> list[Table]:
    """A base minus every other policy, or every other minus the base, measure by measure; none
    where there is nothing to compare.
    """
    # At other budgets than those of the base there is nothing to compare with.
    budgets = [budget for budget in part.budgets if part.rows(base, budget)]
    lines: list[TableRow] = []
    for measure in measures:
        block: list[TableRow] = []
        for policy in others:
            # A positive difference speaks for the policy that stands first.
            pair = (base, policy) if base_first else (policy, base)
            found = [part.contrast(measure, *pair, budget) for budget in budgets]
            if any(found):
                block.append((part.marked(policy), *map(interval, found)))
                if said := of_paper(measure, policy):
                    block.append((PAPER, *said))
        lines += [(measure.heading,), *block] if block else []
    title = f"{base} minus each policy" if base_first else f"each policy minus {base}"
    head = f"{base} minus" if base_first else f"minus {base}"
    return budget_table(
        part,
        f"{title}{weights}",
        head,
        lines,
        notes,
        quotes,
        budgets=budgets,
        terminal=not weights,
    )


def control_tables(part: Part, measures: Sequence[OverControl]) -> list[Table]:
    """Policies minus the best control, measure by measure; none without any difference."""
    lines: list[TableRow] = []
    for each in measures:
        controls = (control or "" for control in each.controls)
        lines += [(each.measure.heading,), (BEST_CONTROL, *controls)]
        lines += [
            (part.marked(policy), *map(interval, differences))
            for policy, differences in each.differences.items()
        ]
    rule = (
        f"The {BEST_CONTROL} has the highest mean of the measure at the budget, over the seeds or "
        "scenes that all controls have. This choice in hindsight favours the control. "
        f"Candidates: {', '.join(part.controls)}."
    )
    title = f"each policy minus the {BEST_CONTROL}"
    return budget_table(part, title, f"minus the {BEST_CONTROL}", lines, (rule,))
