"""The orders of the open loop under their former names, until the figures use the engine."""

from collections.abc import Sequence

from care_sim.evaluation.scene_contrasts import Ratio
from care_sim.reports.protocol.closing import protocol_closing
from care_sim.reports.protocol.rows import plays_by_setting
from care_sim.reports.tables import order
from care_sim.reports.tables.order import order_tables
from care_sim.study.designs.order import rows_by_order
from care_sim.study.run_config import Row

__all__ = ["OrderPlays", "order_closing", "order_tables"]


def order_closing(rows: Sequence[Row]) -> list[str]:
    """Size of the study, and which statements hang on the order of rows."""
    return [*protocol_closing(rows), *order.order_closing(rows)]


class OrderPlays:
    """The plays of the study by order."""

    def __init__(self, rows: Sequence[Row]):
        self.by_order = {
            order: plays_by_setting(own)[0] for order, own in rows_by_order(rows).items()
        }
        first = next(iter(self.by_order.values()))
        self.tags, self.budgets = first.tags, first.budgets
        self.label, self.scenes = first.setting.label, len(first.scenes)

    def level(self, ratio: Ratio, order: str, policy: str, budget: float) -> float | None:
        """A recall in %."""
        return self.by_order[order].level(ratio, policy, budget).by_event
