"""Figures of the study of the order of cells: what every policy detects under every order."""

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from care_sim.base.errors import counted, percent
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
_PER_INCH = 12
"""Letters of a title on an inch."""
_LEGEND_INCHES = 1.6
"""Width of the legend on the right."""
_BAND = 0.7
"""Share of the way from one order to the next that the markers of an order take."""

_Tags = Mapping[str, tuple[str, ...]]


class _Panel(NamedTuple):
    """The heights of every policy that was played, one per order, None where it was not; and that
    of the full scan.
    """

    title: str
    heights: Mapping[str, Sequence[float | None]]
    full: float | None


def order_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Median first detection in metres by order, one panel per place that was played."""
    study = OrderCells(rows)
    panels = [panel for place in _PLACES if (panel := _at(study, place)).heights]
    if not panels:
        return {}
    figure = _figure(panels, study.orders, study.tags, "first detection, median (m)")
    seeds = len({row["seed"] for row in rows})
    _head(figure, f"{counted(seeds, 'seed')} (at 0: not detected)")
    return {ORDER_FIGURE: figure}


def open_order_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """First-sighting recall in % by order, one panel per budget."""
    study = OrderPlays(rows)
    panels = [_under(study, budget) for budget in study.budgets]
    if not panels:
        return {}
    figure = _figure(panels, tuple(study.by_order), study.tags, "first-sighting recall (%)")
    _head(figure, f"{study.label}, {counted(study.scenes, 'scene')}")
    return {OPEN_ORDER_FIGURE: figure}


def _at(study: OrderCells, place: Place) -> _Panel:
    heights = {
        policy: [_median(study, order, place, policy) for order in study.orders]
        for policy in study.tags
    }
    played = {policy: own for policy, own in heights.items() if set(own) != {None}}
    full = played.pop(FULL, [None])[0]
    return _Panel(f"{place}", played, full)


def _median(study: OrderCells, order: str, place: Place, policy: str) -> float | None:
    cell = study.cell(order, USUAL_VARIANT.key(place, policy))
    if cell is None:
        return None
    return _NOT_DETECTED if cell.detection.median is None else cell.detection.median


def _under(study: OrderPlays, budget: float) -> _Panel:
    heights = {
        policy: [study.level(FIRST_SIGHTING, order, policy, budget) for order in study.by_order]
        for policy in study.tags
    }
    full = study.level(FIRST_SIGHTING, next(iter(study.by_order)), FULL, 1.0)
    return _Panel(f"budget {percent(budget)}", heights, full)


def _figure(panels: Sequence[_Panel], orders: Sequence[str], tags: _Tags, label: str) -> Figure:
    figure = Figure(figsize=(2.4 + 2.2 * len(panels), 3.8), layout="constrained")
    drawn = styles((policy, own) for policy, own in tags.items() if policy != FULL)
    row = figure.subplots(1, len(panels), squeeze=False, sharey=True)[0]
    for axes, panel in zip(row, panels, strict=True):
        _draw(axes, panel, drawn, tags)
        axes.set_xticks(range(len(orders)), orders, rotation=45, ha="right")
        axes.tick_params(labelsize=8)
        bare_axes(axes, "0.93")
    row[0].set_ylabel(label)
    # All panels share their heights, and the markers of all decide them.
    row[0].set_ylim(bottom=0)
    figure.supxlabel("\n".join(tag_notes(tags.values())), fontsize=9)
    figure.legend(
        *row[0].get_legend_handles_labels(), loc="outside right upper", frameon=False, fontsize=9
    )
    return figure


def _draw(axes: Axes, panel: _Panel, drawn: Mapping[str, Style], tags: _Tags) -> None:
    """Markers side by side at every order: orders have no sequence, so that no line joins them."""
    width = _BAND / len(drawn)
    for number, (policy, look) in enumerate(drawn.items()):
        shift = width * (number - (len(drawn) - 1) / 2)
        heights = enumerate(panel.heights.get(policy, ()))
        known = {place + shift: height for place, height in heights if height is not None}
        # Matplotlib finds no room for a curve that has no point and is not clipped.
        if known:
            (markers,) = axes.plot(
                list(known), list(known.values()), look.marker, color=look.colour, markersize=6
            )
            markers.set(clip_on=False, label=marked(policy, tags[policy]))
    axes.set_title(panel.title, loc="left", fontsize=10)
    if panel.full is not None:
        axes.axhline(
            panel.full,
            color=FULL_STYLE.colour,
            linestyle=FULL_STYLE.line,
            linewidth=1.2,
            label="full scan",
        )


def _head(figure: Figure, text: str) -> None:
    # The title of a figure of few panels is broken before it reaches the legend.
    room = int(_PER_INCH * (figure.get_figwidth() - _LEGEND_INCHES))
    title = fill(f"order of the cells inside a set: {text}", room)
    figure.suptitle(title, x=0.01, ha="left", fontsize=10)
