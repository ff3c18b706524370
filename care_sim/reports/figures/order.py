"""Figures of the study of the order of cells: what every policy detects under every order."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from care_sim.base.errors import counted, percent
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING
from care_sim.reports.figures.budget import height
from care_sim.reports.figures.curves import FULL_SCAN, Panel, Tags, curves_figure
from care_sim.reports.protocol.rows import plays_by_setting
from care_sim.reports.tables.order import OrderCells
from care_sim.study.designs.order import rows_by_order
from care_sim.study.designs.variants import USUAL_VARIANT, Place
from care_sim.study.run_config import FULL, Row

ORDER_FIGURE = "order"
OPEN_ORDER_FIGURE = "order-open-loop"
_PLACES = (
    Place("dartout", 0.03),
    Place("dartout", 0.10),
    Place("dense", 0.03),
    Place("dense", 0.05),
)
"""The dart-out at the tightest budget of the study and at the one that the paper reports; the dense
street at the tightest, and at the one from which the reserves converge in the paper.
"""


def order_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Median first detection in metres by order, one panel per place that was played."""
    study = OrderCells(rows)
    panels = []
    for place in _PLACES:
        keys = {policy: USUAL_VARIANT.key(place, policy) for policy in study.tags}
        heights = {
            policy: [height(study.cell(order, key)) for order in study.orders]
            for policy, key in keys.items()
        }
        panels.append(_panel(f"{place}", study.orders, heights))
    seeds = counted(len({row["seed"] for row in rows}), "seed")
    return _figures(ORDER_FIGURE, f"first detection (m, median of {seeds})", panels, study.tags)


def open_order_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """First-sighting recall in % by order, one panel per budget."""
    played = {order: plays_by_setting(own)[0] for order, own in rows_by_order(rows).items()}
    orders, study = tuple(played), next(iter(played.values()))
    panels = []
    for budget in study.budgets:
        heights = {
            policy: [
                played[order].level(FIRST_SIGHTING, policy, budget).by_event for order in orders
            ]
            for policy in study.tags
        }
        heights[FULL] = [study.level(FIRST_SIGHTING, FULL, 1.0).by_event]
        panels.append(_panel(f"budget {percent(budget)}", orders, heights))
    title = (
        f"first-sighting recall (%): {study.setting.label}, {counted(len(study.scenes), 'scene')}"
    )
    return _figures(OPEN_ORDER_FIGURE, title, panels, study.tags)


def _panel(title: str, orders: Sequence[str], heights: dict[str, list[float | None]]) -> Panel:
    """The full scan fires all cells, whatever their order."""
    full = heights.pop(FULL, [None])[0]
    played = {policy: own for policy, own in heights.items() if {*own} != {None}}
    return Panel(title, orders, played, lines={} if full is None else {FULL_SCAN: full})


def _figures(name: str, title: str, panels: Sequence[Panel], tags: Tags) -> dict[str, Figure]:
    shown = [panel for panel in panels if panel.heights]
    if not shown:
        return {}
    heading = f"order of the cells inside a set: {title}"
    return {name: curves_figure(heading, shown, tags, columns=2, share=True)}
