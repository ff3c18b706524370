"""The shape of the tables by order of cells, the same in both loops: a measure under every order,
and its differences to the usual one.
"""

from collections.abc import Collection, Iterable, Sequence
from typing import NamedTuple

from care_sim.reports.table import Table
from care_sim.study.designs.order import BASE_ORDER

_NAMES = ("policy", "budget")

Lines = Iterable[tuple[str, ...]]
"""Policy, budget and an entry per order; or a heading alone."""


class Shown(NamedTuple):
    """What a measure is called in a title, and the units of its levels and differences there."""

    title: str
    level_unit: str
    difference_unit: str


def other_orders(orders: Iterable[str]) -> tuple[str, ...]:
    """Those that the usual one is compared with."""
    return tuple(order for order in orders if order != BASE_ORDER)


def tables_by_order(
    shown: Shown,
    orders: Collection[str],
    levels: Lines,
    changes: Lines,
    notes: Sequence[str],
    on_changes: Sequence[str] = (),
    terminal: bool = True,
) -> list[Table]:
    """The levels under all `orders`, and the changes of the others against the usual one, which
    have further notes; that table is printed on a `terminal` or stands in files alone.
    """
    title = f"{shown.title} by order of cells"
    return [
        Table(
            f"{title}, {shown.level_unit}",
            (*_NAMES, *orders),
            tuple(levels),
            tuple(notes),
            whole=_NAMES,
            names=len(_NAMES),
        ),
        Table(
            f"{title}, minus {BASE_ORDER}, {shown.difference_unit}",
            (*_NAMES, *other_orders(orders)),
            tuple(changes),
            (*on_changes, *notes),
            whole=_NAMES,
            names=len(_NAMES),
            terminal=terminal,
        ),
    ]


def played_once(policies: Sequence[str]) -> tuple[str, ...]:
    """A note on policies that feel no order; none where all do."""
    return (f"Feel no order, played once: {', '.join(policies)}.",) if policies else ()
