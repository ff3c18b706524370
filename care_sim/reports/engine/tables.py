"""Tables that both loops share: one policy minus others, and policies minus the best control."""

from collections.abc import Callable, Iterable, Mapping, Sequence

from care_sim.base.errors import percent
from care_sim.reports.engine.controls import BEST_CONTROL, RULE, candidates
from care_sim.reports.engine.measures import Measure, Recall
from care_sim.reports.engine.parts import OverControl, Part
from care_sim.reports.formatting import interval
from care_sim.reports.table import Table, TableRow

PAPER = "(paper)"
"""What the line under a policy begins with that holds the paper's numbers."""
OfPaper = Callable[[Measure | Recall, str], Sequence[str]]
"""What the paper says of a policy in a measure, budget by budget; empty where it says nothing."""


def under_headings(lines: Mapping[str, Iterable[TableRow]]) -> tuple[TableRow, ...]:
    """The rows of a table, each part below its heading."""
    return tuple(line for heading, own in lines.items() for line in ((heading,), *own))


def minus_table(
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
) -> Table:
    """A base minus every other policy, or every other minus the base, measure by measure."""
    # At other budgets than those of the base there is nothing to compare with.
    budgets = [budget for budget in part.budgets if part.rows(base, budget)]
    lines: list[TableRow] = []
    for measure in measures:
        lines.append((measure.heading,))
        for policy in others:
            # A positive difference speaks for the policy that stands first.
            pair = (base, policy) if base_first else (policy, base)
            found = [part.contrast(measure, *pair, budget) for budget in budgets]
            if any(found):
                lines.append((part.marked(policy), *map(interval, found)))
                if said := of_paper(measure, policy):
                    lines.append((PAPER, *said))
    title, head = (
        (f"{base} minus each policy", f"{base} minus")
        if base_first
        else (f"each policy minus {base}", f"minus {base}")
    )
    columns = (head, *map(percent, budgets))
    return Table(
        f"{part.setting.label}: {title}{weights}",
        columns,
        tuple(lines),
        (*notes, *part.notes),
        tuple(quotes),
        whole=columns[:1],
        terminal=not weights,
    )


def control_tables(
    part: Part, measures: Sequence[OverControl], notes: Sequence[str] = ()
) -> list[Table]:
    """Policies minus the best control, measure by measure; none without any difference."""
    lines: list[TableRow] = []
    for each in measures:
        lines += [
            (each.measure.heading,),
            (BEST_CONTROL, *(control or "" for control in each.controls)),
        ]
        lines += [
            (part.marked(policy), *map(interval, differences))
            for policy, differences in each.differences.items()
        ]
    if not lines:
        return []
    return [
        Table(
            f"{part.setting.label}: each policy minus the {BEST_CONTROL}",
            (f"minus the {BEST_CONTROL}", *map(percent, part.budgets)),
            tuple(lines),
            (" ".join([*notes, RULE, candidates(part.controls)]), *part.notes),
        )
    ]
