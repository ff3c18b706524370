"""The tables of realism, the same in both loops: how many orders of the headline tables hold, which
change, all of them under every condition, and every policy's figures.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence

from care_sim.reports.formatting import interval
from care_sim.reports.realism.orders import Order, Verdict
from care_sim.reports.realism.study import Block, RealismStudy
from care_sim.reports.table import Table, TableRow
from care_sim.study.designs.realism import IDEAL
from care_sim.study.run_config import Row

__all__ = ["RealismStudy", "realism_tables"]


def realism_tables(rows: Sequence[Row]) -> list[Table]:
    """Verdicts, orders, the second column, and the figures under every condition."""
    study = RealismStudy(rows)
    tables = [*_order_tables(study), _second_column(study), _levels(study)]
    return [table for table in tables if table.rows]


def _order_tables(study: RealismStudy) -> Iterator[Table]:
    """How many orders hold, the ones that change, and all under every condition."""
    counts: list[TableRow] = []
    lines: list[TableRow] = []
    changed: list[TableRow] = []
    for measure, orders in study.orders().items():
        told = [
            (verdict, order, each.label)
            for order in orders
            for each in study.conditions
            if (verdict := order.verdict(each.label))
        ]
        counter = Counter(verdict for verdict, _, _ in told)
        counts += [(measure, *(str(counter[each]) for each in Verdict))] if told else []
        # First what flips, then what is lost, then leads where there was a tie.
        changes: list[TableRow] = [
            (
                order.label,
                label,
                *(interval(order.standings[at].difference) for at in (IDEAL.label, label)),
                verdict,
            )
            for wanted in (Verdict.FLIPS, Verdict.LOST, Verdict.ARISES)
            for verdict, order, label in told
            if verdict is wanted
        ]
        heading: list[TableRow] = [(measure,)] if measure else []
        changed += [*heading, *changes] if changes else []
        lines += heading
        lines += [
            (order.label, *(_entry(order, each.label) for each in study.conditions))
            for order in orders
        ]
    title = f"{study.title}: orders"
    yield Table(f"{title} by verdict", ("measure", *Verdict), tuple(counts))
    yield Table(
        f"{title} that change, {study.unit}",
        ("order", "condition", IDEAL.label, "under the condition", "verdict"),
        tuple(changed),
        names=2,
    )
    yield Table(
        f"{title} of the headline tables by condition, {study.unit}",
        ("order", *(condition.label for condition in study.conditions)),
        tuple(lines),
        terminal=False,
    )


def _entry(order: Order, condition: str) -> str:
    """The difference with its interval, and the verdict."""
    standing = order.standings.get(condition)
    text = interval(standing.difference) if standing else ""
    verdict = order.verdict(condition)
    # Bold is a type of text: the entry keeps that of the difference.
    return type(text)(f"{text} {verdict}") if verdict else text


def _second_column(study: RealismStudy) -> Table:
    columns = [IDEAL.label]
    for camera in study.cameras:
        columns += [camera.label, f"change, {study.unit}"]

    def entries(block: Block, policy: str) -> Iterator[str]:
        yield block.level(IDEAL, policy)
        for camera in study.cameras:
            yield block.level(camera, policy)
            yield interval(block.change(camera, policy))

    return _by_policy(study, "the ideal and a realistic camera", columns, entries)


def _levels(study: RealismStudy) -> Table:
    columns = [condition.label for condition in study.conditions]
    return _by_policy(
        study,
        "every condition",
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
        f"{study.title}: {title}, {study.levels_told}",
        ("policy", *columns),
        tuple(lines),
        study.frame.notes(study.frame.tags),
        whole=("policy",),
        terminal=terminal,
    )
