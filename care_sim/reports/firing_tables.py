"""The shape of the tables by hardware, the same in both loops: a measure under every hardware, and
what the policy that knows it has over each of the others.
"""

from collections.abc import Callable, Collection, Sequence

from care_sim.base.errors import percent
from care_sim.reports.formatting import marked, tag_notes
from care_sim.reports.order_tables import Shown
from care_sim.reports.table import Table
from care_sim.study.designs.firing import AWARE
from care_sim.study.rows.reading import Key
from care_sim.study.run_config import FULL

_NAMES = ("policy", "budget")
Entry = Callable[[str, Key], str]
"""What a table says of a cell under a hardware."""


def tables_by_firing(
    shown: Shown,
    firings: Collection[str],
    keys: Sequence[Key],
    tags: dict[str, tuple[str, ...]],
    level: Entry,
    lead: Entry,
) -> list[Table]:
    """The levels of all cells by hardware, and the lead of the policy that knows its hardware over
    the other policies at the same budget.
    """

    def lines(entry: Entry, chosen: Sequence[Key]) -> tuple[tuple[str, ...], ...]:
        return tuple(
            (
                marked(key[1], tags.get(key[1], ())),
                percent(key[2]),
                *(entry(firing, key) for firing in firings),
            )
            for key in chosen
        )

    notes = tag_notes(tags.values())
    columns = (*_NAMES, *firings)
    title = f"{shown.title} by hardware"
    tables = [
        Table(
            f"{title}, {shown.level_unit}",
            columns,
            lines(level, keys),
            notes,
            whole=_NAMES,
            names=len(_NAMES),
        )
    ]
    played = {key[1] for key in keys}
    if AWARE in played and (others := [key for key in keys if key[1] not in (AWARE, FULL)]):
        leads = lines(lead, others)
        title = f"{title}, {AWARE} minus each, {shown.difference_unit}"
        tables.append(Table(title, columns, leads, notes, whole=_NAMES, names=len(_NAMES)))
    return tables
