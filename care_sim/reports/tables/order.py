"""What the order of cells inside a set does: the paper's statements and the levels of all policies,
order by order, in either loop.
"""

from collections.abc import Iterator, Sequence

from care_sim.base.errors import counted, percent
from care_sim.reports.engine.contrasts import contrast
from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.levels import Cell, level, level_of
from care_sim.reports.engine.measures import Measure, Recall, loop_of
from care_sim.reports.engine.tables import condition_table, setting_blocks
from care_sim.reports.formatting import interval
from care_sim.reports.order_verdicts import Verdict, Verdicts, on_mirrored_order, verdict_tables
from care_sim.reports.protocol.formatting import claim_in_short, verdict
from care_sim.reports.protocol.paper import claims_about
from care_sim.reports.protocol.rows import SettingPlays, plays_by_setting
from care_sim.reports.table import Table
from care_sim.reports.tables.paper_statements import statements
from care_sim.study.designs.order import BASE_ORDER, rows_by_order, without_order
from care_sim.study.rows.reading import Key
from care_sim.study.run_config import FULL, Row


class OrderStudy:
    """The rows of the study by order. Cells of one key differ in nothing but the order."""

    def __init__(self, rows: Sequence[Row]):
        self.frames = {order: Frame(own) for order, own in rows_by_order(rows).items()}
        self.once = without_order(rows)
        self.tags = {
            policy: frame.tags[policy]
            for frame in self.frames.values()
            for _, policy, _ in frame.groups
        }

    @property
    def keys(self) -> list[Key]:
        """Of all cells, settings together and by budget."""
        found = dict.fromkeys(key for frame in self.frames.values() for key in frame.groups)
        settings = list(dict.fromkeys(key[0] for key in found))
        return sorted(found, key=lambda key: (settings.index(key[0]), key[2]))

    def level(self, order: str, measure: Measure | Recall, key: Key) -> str:
        """A level under an order."""
        return level(measure, self.frames[order].units(measure, key))

    def change(self, order: str, measure: Measure | Recall, key: Key) -> str:
        """A cell under an order minus that under the usual one, paired by seed or scene."""
        if BASE_ORDER not in self.frames:
            return ""
        ours, usual = (self.frames[each].units(measure, key) for each in (order, BASE_ORDER))
        return interval(contrast(measure, ours, usual))


class OrderCells(OrderStudy):
    """What the figure reads of episodes."""

    @property
    def orders(self) -> tuple[str, ...]:
        """The orders that were played."""
        return tuple(self.frames)

    def cell(self, order: str, key: Key) -> Cell | None:
        """What was measured; None where it was not played."""
        return level_of(self.frames[order], key)


def order_tables(rows: Sequence[Row]) -> list[Table]:
    """The paper's statements by order, then levels and their differences to the usual order."""
    study = OrderStudy(rows)
    if set(study.tags) <= {FULL}:
        return []
    loop = loop_of(rows)
    orders = list(study.frames)
    episodes = max(len(own) for frame in study.frames.values() for own in frame.groups.values())
    title = f"{loop.shown} by order of cells"
    ordered = [key for key in study.keys if key[1] not in study.once]
    played = f"Each cell has at most {counted(episodes, 'row')}."
    notes = [f"Feel no order, played once: {', '.join(study.once)}."] if study.once else []
    return [
        *verdict_tables("The paper's statements by order of cells", verdicts(rows), played),
        condition_table(
            f"{title}, {loop.level_unit}",
            orders,
            setting_blocks(study.keys, loop),
            study.tags,
            study.level,
            notes,
        ),
        condition_table(
            f"{title}, minus {BASE_ORDER}, {loop.difference_unit}",
            [order for order in orders if order != BASE_ORDER],
            setting_blocks(ordered, loop),
            study.tags,
            study.change,
            terminal=False,
        ),
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
