"""The figure of realism: a map of what becomes of every headline order under every condition."""

from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from care_sim.reports.formatting import signed
from care_sim.reports.realism.episodes import RealismEpisodes
from care_sim.reports.realism.orders import Order, Verdict
from care_sim.reports.realism.plays import RealismPlays
from care_sim.reports.realism.tables import RealismStudy
from care_sim.study.run_config import Row

REALISM_FIGURE = "realism"
OPEN_REALISM_FIGURE = "realism-open-loop"
_COLOURS = {
    Verdict.HOLDS: "#56B4E9",
    Verdict.LOST: "#F0E442",
    Verdict.FLIPS: "#D55E00",
    Verdict.TIED: "0.9",
    Verdict.ARISES: "#CC79A7",
}
"""From the palette of Okabe and Ito (2008), safe for the colour-blind."""
_CELL_INCHES = 0.55, 0.24
_NAMES_INCHES = 2.6, 2.6
"""Room for the names of conditions on the left and for those of orders below."""


def realism_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """The map of the closed loop; none where no order was played."""
    return _figures(REALISM_FIGURE, RealismEpisodes(rows))


def open_realism_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """The map of the open loop; none where no order was played."""
    return _figures(OPEN_REALISM_FIGURE, RealismPlays(rows))


def _figures(name: str, study: RealismStudy) -> dict[str, Figure]:
    played = {measure: orders for measure, orders in study.orders().items() if orders}
    return {name: _figure(study, played)} if played else {}


def _figure(study: RealismStudy, by_measure: Mapping[str, Sequence[Order]]) -> Figure:
    across = max(map(len, by_measure.values()))
    width, height = _CELL_INCHES
    left, below = _NAMES_INCHES
    down = len(by_measure) * len(study.conditions)
    figure = Figure(
        figsize=(max(left + width * across, 7.0), below + 0.4 + height * down),
        layout="constrained",
    )
    panels = figure.subplots(len(by_measure), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (measure, orders) in zip(panels, by_measure.items(), strict=True):
        _draw(axes, study, orders)
        axes.set_title(measure, loc="left", fontsize=8)
    labels = [order.label for order in next(iter(by_measure.values()))]
    panels[-1].set_xticks(range(len(labels)), labels, rotation=60, ha="right", fontsize=7)
    title = f"{study.title}: first policy minus second, {study.unit}"
    figure.suptitle(title, x=0.01, ha="left", fontsize=9)
    figure.legend(
        [Patch(color=colour) for colour in _COLOURS.values()],
        [*_COLOURS],
        loc="outside lower left",
        ncols=len(_COLOURS),
        frameon=False,
        fontsize=8,
    )
    return figure


def _draw(axes: Axes, study: RealismStudy, orders: Sequence[Order]) -> None:
    labels = [condition.label for condition in study.conditions]
    for row, condition in enumerate(labels):
        for column, order in enumerate(orders):
            if standing := order.standings.get(condition):
                verdict = order.verdict(condition)
                colour = _COLOURS[verdict] if verdict else "white"
                corner = column - 0.48, row - 0.48
                axes.add_patch(Rectangle(corner, 0.96, 0.96, color=colour, linewidth=0))
                text = signed(standing.difference)
                axes.text(column, row, text, ha="center", va="center", fontsize=6)
    axes.set_xlim(-0.5, len(orders) - 0.5)
    axes.set_ylim(len(labels) - 0.5, -0.5)
    axes.set_yticks(range(len(labels)), labels, fontsize=7)
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
