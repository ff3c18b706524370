"""What the order of cells inside a set does: the paper's statements and the levels of all policies,
order by order, in either loop.
"""

from collections.abc import Iterator, Sequence

from care_sim.base.errors import counted, percent
from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.levels import Cell, level_of
from care_sim.reports.engine.varied import Varied
from care_sim.reports.formatting import interval
from care_sim.reports.protocol.formatting import claim_in_short, verdict
from care_sim.reports.protocol.paper import claims_about
from care_sim.reports.protocol.rows import SettingPlays, plays_by_setting
from care_sim.reports.table import Table
from care_sim.reports.tables.order_verdicts import (
    Verdict,
    Verdicts,
    on_mirrored_order,
    verdict_tables,
)
from care_sim.reports.tables.paper_statements import statements
from care_sim.study.designs.order import BASE_ORDER, rows_by_order, without_order
from care_sim.study.rows.reading import Key
from care_sim.study.run_config import FULL, Row


class OrderCells:
    """The rows of the study by order; what the figure reads of episodes."""

    def __init__(self, rows: Sequence[Row]):
        self.frames = {order: Frame(own) for order, own in rows_by_order(rows).items()}
        self.orders = tuple(self.frames)
        self.tags = {p: frame.tags[p] for frame in self.frames.values() for _, p, _ in frame.groups}

    def cell(self, order: str, key: Key) -> Cell | None:
        """What was measured; None where it was not played."""
        return level_of(self.frames[order], key)


def order_tables(rows: Sequence[Row]) -> list[Table]:
    """The paper's statements by order, then levels and their differences to the usual order."""
    study = OrderCells(rows)
    if set(study.tags) <= {FULL}:
        return []
    rows_of_cell = max(len(own) for each in study.frames.values() for own in each.groups.values())
    played = f"Each cell has at most {counted(rows_of_cell, 'row')}."
    once = without_order(rows)
    notes = [f"Feel no order, played once: {', '.join(once)}."] if once else []
    varied = Varied("order of cells", study.frames, notes)
    return [
        *verdict_tables("The paper's statements by order of cells", verdicts(rows), played),
        varied.levels(),
        varied.minus_usual(BASE_ORDER, unfelt=once),
    ]


def order_closing(rows: Sequence[Row]) -> list[str]:
    """Which statements hang on whether rows are numbered from the top or from the bottom."""
    return on_mirrored_order(verdicts(rows))


def verdicts(rows: Sequence[Row]) -> Verdicts:
    """Every statement of the paper on what was played, under every order."""
    by_order = rows_by_order(rows)
    if "source" in rows[0]:
        return {order: dict(_judged(plays_by_setting(own)[0])) for order, own in by_order.items()}
    return {
        order: {each.text: Verdict(each.verdict, each.measured) for each in statements(own)}
        for order, own in by_order.items()
    }


def _judged(plays: SettingPlays) -> Iterator[tuple[str, Verdict]]:
    for each, claims in claims_about(plays.setting).items():
        if not set(each.policies) <= set(plays.policies):
            continue
        for budget in plays.budgets:
            claim = claims.at(budget)
            found = each.measured(plays, budget) if claim else None
            if claim and found:
                text = f"{each.label}, {each.heading.lower()}, {percent(budget)}"
                yield (
                    f"{text} (paper: {claim_in_short(claim)})",
                    Verdict(verdict(found, claim.sign), interval(found)),
                )
