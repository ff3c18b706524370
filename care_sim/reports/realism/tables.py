"""The shape of the tables of realism, the same in both loops: the orders of the headline tables
under every condition, those that change, and every policy's figures.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Protocol

from care_sim.reports.formatting import ShownDifference, interval
from care_sim.reports.realism.orders import Order, Verdict, changes
from care_sim.reports.table import Table, TableRow
from care_sim.study.designs.realism import IDEAL
from care_sim.study.designs.variants import Variant

_NAMES = ("policy",)


class RealismStudy(Protocol):
    """What was played of the study in one of the loops."""

    @property
    def title(self) -> str:
        """Which loop."""
        ...

    @property
    def unit(self) -> str:
        """That of differences."""
        ...

    @property
    def levels_told(self) -> str:
        """What the figure of a policy is."""
        ...

    @property
    def conditions(self) -> Sequence[Variant]:
        """Those that were played."""
        ...

    @property
    def cameras(self) -> Sequence[Variant]:
        """Of those, the ones that change the camera alone."""
        ...

    def orders(self) -> Mapping[str, Sequence[Order]]:
        """The orders by measure; the measure is empty where each headline table has its own."""
        ...

    def blocks(self) -> Mapping[str, Sequence[str]]:
        """The policies of every block of levels, by its heading."""
        ...

    def level(self, block: str, condition: Variant, policy: str) -> str:
        """The figure of a policy; empty where it was not played."""
        ...

    def change(self, block: str, condition: Variant, policy: str) -> ShownDifference | None:
        """What the condition adds to the measure of a policy."""
        ...

    def marked(self, policy: str) -> str:
        """A policy's name, with a mark when no car can have it."""
        ...

    def notes(self) -> tuple[str, ...]:
        """What the marks mean."""
        ...


def tables_of(study: RealismStudy) -> list[Table]:
    """The orders, those that change, the second column, and the figures under every condition."""
    tables = [_orders(study), _changes(study), _second_column(study), _levels(study)]
    return [table for table in tables if table.rows]


def verdict_sentences(study: RealismStudy) -> list[str]:
    """How many orders hold, by measure."""
    return [
        sentence
        for measure, orders in study.orders().items()
        if (sentence := _counted(measure, orders))
    ]


def _counted(measure: str, orders: Sequence[Order]) -> str:
    counts = Counter(
        verdict
        for order in orders
        for condition in order.standings
        if (verdict := order.verdict(condition))
    )
    if not counts:
        return ""
    leads = sum(counts[each] for each in (Verdict.HOLDS, Verdict.LOST, Verdict.FLIPS))
    ties = counts[Verdict.TIED] + counts[Verdict.ARISES]
    subject = f"{measure}: of" if measure else "Of"
    return (
        f"{subject} {leads} leads under a condition {counts[Verdict.HOLDS]} hold, "
        f"{counts[Verdict.LOST]} are lost and {counts[Verdict.FLIPS]} flip; of {ties} ties "
        f"{counts[Verdict.ARISES]} become a lead."
    )


def _orders(study: RealismStudy) -> Table:
    by_measure = study.orders()
    first = next(iter(by_measure.values()), ())
    lines: list[TableRow] = []
    for measure, orders in by_measure.items():
        lines += [(measure,)] if measure else []
        for condition in study.conditions:
            lines.append((condition.label, *(_entry(order, condition.label) for order in orders)))
    return Table(
        f"{study.title}: orders of the headline tables by condition, {study.unit}",
        ("condition", *(order.label for order in first)),
        tuple(lines),
        terminal=False,
    )


def _entry(order: Order, condition: str) -> str:
    """The difference with its interval, and the verdict."""
    standing = order.standings.get(condition)
    if standing is None:
        return ""
    text = interval(standing.difference)
    verdict = order.verdict(condition)
    # Bold is a type of text: the entry keeps that of the difference.
    return type(text)(f"{text} {verdict}") if verdict else text


def _changes(study: RealismStudy) -> Table:
    lines: list[TableRow] = []
    for measure, orders in study.orders().items():
        found = [*changes(orders)]
        lines += [(measure,)] if measure and found else []
        lines += [
            (
                order.label,
                condition,
                interval(order.standings[IDEAL.label].difference),
                interval(order.standings[condition].difference),
                verdict,
            )
            for order, condition, verdict in found
        ]
    return Table(
        f"{study.title}: orders that change, {study.unit}",
        ("order", "condition", IDEAL.label, "under the condition", "verdict"),
        tuple(lines),
        names=2,
    )


def _second_column(study: RealismStudy) -> Table:
    columns = [IDEAL.label]
    for camera in study.cameras:
        columns += [camera.label, f"change, {study.unit}"]

    def entries(block: str, policy: str) -> Iterator[str]:
        yield study.level(block, IDEAL, policy)
        for camera in study.cameras:
            yield study.level(block, camera, policy)
            yield interval(study.change(block, camera, policy))

    return _by_policy(
        study, f"the ideal and a realistic camera, {study.levels_told}", columns, entries
    )


def _levels(study: RealismStudy) -> Table:
    def entries(block: str, policy: str) -> Iterator[str]:
        for condition in study.conditions:
            yield study.level(block, condition, policy)

    columns = [condition.label for condition in study.conditions]
    return _by_policy(
        study, f"every condition, {study.levels_told}", columns, entries, terminal=False
    )


def _by_policy(
    study: RealismStudy,
    title: str,
    columns: Sequence[str],
    entries: Callable[[str, str], Iterator[str]],
    terminal: bool = True,
) -> Table:
    lines: list[TableRow] = []
    for block, policies in study.blocks().items():
        lines.append((block,))
        lines += [(study.marked(policy), *entries(block, policy)) for policy in policies]
    return Table(
        f"{study.title}: {title}",
        (*_NAMES, *columns),
        tuple(lines),
        study.notes(),
        whole=_NAMES,
        terminal=terminal,
    )
