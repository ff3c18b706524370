"""Figures of the study of the order of cells: what every policy detects under every order."""

from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from care_sim.base.errors import percent
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING
from care_sim.reports.figures.styles import FULL_STYLE, Style, bare_axes, styles
from care_sim.reports.formatting import marked, tag_notes
from care_sim.reports.protocol.order import OrderPlays
from care_sim.reports.tables.order import OrderCells
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
_NOT_DETECTED = 0.0
"""Where a median stands that is not detected, in metres."""


def order_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Median first detection in metres by order, one panel per place."""
    study = OrderCells(rows)
    drawn = styles((policy, tags) for policy, tags in study.tags.items() if policy != FULL)
    figure, panels = _panels(len(_PLACES), "first detection, median (m)")
    for axes, place in zip(panels, _PLACES, strict=True):
        _draw(axes, study.orders, _detections(study, place, [*drawn]), drawn, study.tags)
        full = _detections(study, place, [FULL])[FULL]
        _ceiling(axes, next((value for value in full if value is not None), None))
        axes.set_title(f"{place}", loc="left", fontsize=10)
    seeds = len({row["seed"] for row in rows})
    _name(figure, panels[0], f"order of the cells inside a set, {seeds} seeds", study.tags)
    return {ORDER_FIGURE: figure}


def open_order_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """First-sighting recall in % by order, one panel per budget."""
    study = OrderPlays(rows)
    drawn = styles(study.tags.items())
    orders = tuple(study.by_order)
    if not drawn:
        return {}
    figure, panels = _panels(len(study.budgets), "first-sighting recall (%)")
    for axes, budget in zip(panels, study.budgets, strict=True):
        heights = {
            policy: [study.level(FIRST_SIGHTING, order, policy, budget) for order in orders]
            for policy in drawn
        }
        _draw(axes, orders, heights, drawn, study.tags)
        _ceiling(axes, study.level(FIRST_SIGHTING, orders[0], FULL, 1.0))
        axes.set_title(f"budget {percent(budget)}", loc="left", fontsize=10)
    _name(figure, panels[0], f"{study.label}: {study.scenes} scenes", study.tags)
    return {OPEN_ORDER_FIGURE: figure}


def _detections(
    study: OrderCells, place: Place, policies: Sequence[str]
) -> dict[str, list[float | None]]:
    return {
        policy: [_median(study, order, place, policy) for order in study.orders]
        for policy in policies
    }


def _median(study: OrderCells, order: str, place: Place, policy: str) -> float | None:
    """None where the cell was not played."""
    cell = study.cell(order, USUAL_VARIANT.key(place, policy))
    if cell is None:
        return None
    return _NOT_DETECTED if cell.detection.median is None else cell.detection.median


def _panels(count: int, label: str) -> tuple[Figure, Sequence[Axes]]:
    figure = Figure(figsize=(2.4 + 2.2 * count, 3.8), layout="constrained")
    panels = figure.subplots(1, count, squeeze=False, sharey=True)[0]
    panels[0].set_ylabel(label)
    return figure, panels


def _draw(
    axes: Axes,
    orders: Sequence[str],
    heights: Mapping[str, Sequence[float | None]],
    drawn: Mapping[str, Style],
    tags: Mapping[str, tuple[str, ...]],
) -> None:
    """Markers side by side at every order: orders have no sequence, so that no line joins them."""
    width = 0.7 / max(len(drawn), 1)
    for number, (policy, look) in enumerate(drawn.items()):
        shift = width * (number - (len(drawn) - 1) / 2)
        known = {
            place + shift: height
            for place, height in enumerate(heights[policy])
            if height is not None
        }
        axes.plot(
            list(known),
            list(known.values()),
            look.marker,
            color=look.colour,
            markersize=6,
            label=marked(policy, tags[policy]),
        )
    axes.set_xticks(range(len(orders)), orders, rotation=45, ha="right")
    axes.set_ylim(bottom=0)
    axes.tick_params(labelsize=8)
    bare_axes(axes, "0.93")


def _ceiling(axes: Axes, height: float | None) -> None:
    if height is not None:
        axes.axhline(
            height,
            color=FULL_STYLE.colour,
            linestyle=FULL_STYLE.line,
            linewidth=1.2,
            label="full scan",
        )


def _name(figure: Figure, axes: Axes, title: str, tags: Mapping[str, tuple[str, ...]]) -> None:
    figure.suptitle(title, x=0.01, ha="left", fontsize=10)
    if notes := tag_notes(tags.values()):
        figure.supxlabel("\n".join(notes), fontsize=9)
    figure.legend(
        *axes.get_legend_handles_labels(), loc="outside right upper", frameon=False, fontsize=9
    )
