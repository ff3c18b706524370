"""The tables of realism, the same in both loops: the orders of the headline tables under every
condition, those that change, and every policy's figures.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence

from care_sim.reports.formatting import interval, tag_notes
from care_sim.reports.realism.orders import Order, Verdict, changes
from care_sim.reports.realism.study import Block, RealismStudy
from care_sim.reports.table import Table, TableRow
from care_sim.study.designs.realism import IDEAL
from care_sim.study.run_config import Row


def realism_tables(rows: Sequence[Row]) -> list[Table]:
    """The orders, those that change, the second column, and the figures under every condition."""
    study = RealismStudy(rows)
    orders = study.orders()
    tables = [
        _orders(study, orders),
        _changes(study, orders),
        _second_column(study),
        _levels(study),
    ]
    return [table for table in tables if table.rows]


def verdict_sentences(rows: Sequence[Row]) -> list[str]:
    """How many orders hold, by measure."""
    found = (_counted(measure, orders) for measure, orders in RealismStudy(rows).orders().items())
    return [sentence for sentence in found if sentence]


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


def _orders(study: RealismStudy, by_measure: Mapping[str, Sequence[Order]]) -> Table:
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


def _changes(study: RealismStudy, by_measure: Mapping[str, Sequence[Order]]) -> Table:
    lines: list[TableRow] = []
    for measure, orders in by_measure.items():
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

    def entries(block: Block, policy: str) -> Iterator[str]:
        yield block.level(IDEAL, policy)
        for camera in study.cameras:
            yield block.level(camera, policy)
            yield interval(block.change(camera, policy))

    return _by_policy(
        study, f"the ideal and a realistic camera, {study.levels_told}", columns, entries
    )


def _levels(study: RealismStudy) -> Table:
    columns = [condition.label for condition in study.conditions]
    return _by_policy(
        study,
        f"every condition, {study.levels_told}",
        columns,
        lambda block, policy: (block.level(each, policy) for each in study.conditions),
        terminal=False,
    )


def _by_policy(
    study: RealismStudy,
    title: str,
    columns: Sequence[str],
    entries: Callable[[Block, str], Iterator[str]],
    terminal: bool = True,
) -> Table:
    lines: list[TableRow] = []
    for block in study.blocks:
        lines.append((block.name,))
        lines += [
            (study.frame.marked(policy), *entries(block, policy)) for policy in block.policies
        ]
    return Table(
        f"{study.title}: {title}",
        ("policy", *columns),
        tuple(lines),
        tag_notes(study.frame.tags.values()),
        whole=("policy",),
        terminal=terminal,
    )
