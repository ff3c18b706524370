"""The figure of realism: a map of what becomes of every headline order under every condition."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from care_sim.reports.figures.maps import draw_map
from care_sim.reports.formatting import signed
from care_sim.reports.realism.episodes import RealismEpisodes
from care_sim.reports.realism.orders import Order, Verdict
from care_sim.reports.realism.plays import RealismPlays
from care_sim.reports.realism.tables import RealismStudy
from care_sim.study.run_config import Row

REALISM_FIGURE = "realism"
OPEN_REALISM_FIGURE = "realism-open-loop"
_COLOURS: Mapping[Verdict | None, str] = {
    Verdict.HOLDS: "#56B4E9",
    Verdict.LOST: "#F0E442",
    Verdict.FLIPS: "#D55E00",
    Verdict.TIED: "0.9",
    Verdict.ARISES: "#CC79A7",
    None: "white",
}
"""From the palette of Okabe and Ito (2008), safe for the colour-blind."""
_KINDS = [*_COLOURS]
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
    by_measure = {measure: orders for measure, orders in study.orders().items() if orders}
    if not by_measure:
        return {}
    (width, height), (left, below) = _CELL_INCHES, _NAMES_INCHES
    across = max(map(len, by_measure.values()))
    down = len(by_measure) * len(study.conditions)
    size = max(left + width * across, 7.0), below + 0.4 + height * down
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(len(by_measure), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (measure, orders) in zip(panels, by_measure.items(), strict=True):
        _draw(axes, [condition.label for condition in study.conditions], orders)
        axes.set_title(measure, loc="left", fontsize=8)
    for label in panels[-1].get_xticklabels():
        label.set(rotation=60, ha="right")
    title = f"{study.title}: first policy minus second, {study.unit}"
    figure.suptitle(title, x=0.01, ha="left", fontsize=9)
    keys = [Patch(color=colour, label=kind) for kind, colour in _COLOURS.items() if kind]
    figure.legend(handles=keys, loc="outside lower left", ncols=len(keys), fontsize=8)
    return {name: figure}


def _draw(axes: Axes, conditions: Sequence[str], orders: Sequence[Order]) -> None:
    kinds = np.full((len(conditions), len(orders)), np.nan)
    texts = [[""] * len(orders) for _ in conditions]
    for line, condition in enumerate(conditions):
        for column, order in enumerate(orders):
            if standing := order.standings.get(condition):
                kinds[line, column] = _KINDS.index(order.verdict(condition))
                texts[line][column] = signed(standing.difference)
    names = [order.label for order in orders]
    palette = ListedColormap([*_COLOURS.values()])
    draw_map(axes, kinds, conditions, names, texts, cmap=palette, vmin=-0.5, vmax=len(_KINDS) - 0.5)
