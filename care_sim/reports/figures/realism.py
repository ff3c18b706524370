"""The figure of realism: a map of what becomes of every headline order under every condition."""

from collections.abc import Sequence

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from care_sim.reports.figures.maps import Map, maps_figure
from care_sim.reports.formatting import signed
from care_sim.reports.tables.realism import Order, RealismStudy, Verdict
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


def realism_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """The map of the closed loop; none where no order was played."""
    return _figures(REALISM_FIGURE, RealismStudy(rows))


def open_realism_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """The map of the open loop; none where no order was played."""
    return _figures(OPEN_REALISM_FIGURE, RealismStudy(rows))


def _figures(name: str, study: RealismStudy) -> dict[str, Figure]:
    by_measure = {measure: orders for measure, orders in study.orders().items() if orders}
    if not by_measure:
        return {}
    conditions = [condition.label for condition in study.conditions]
    figure = maps_figure(
        f"{study.title}: first policy minus second, {study.unit}",
        [[_map(measure, conditions, orders)] for measure, orders in by_measure.items()],
        conditions,
        [order.label for order in next(iter(by_measure.values()))],
        cmap=ListedColormap([*_COLOURS.values()]),
        vmin=-0.5,
        vmax=len(_COLOURS) - 0.5,
    )
    keys = [Patch(color=colour, label=verdict) for verdict, colour in _COLOURS.items()]
    figure.legend(handles=keys, loc="outside lower left", ncols=len(keys), fontsize=8)
    return {name: figure}


def _map(measure: str, conditions: Sequence[str], orders: Sequence[Order]) -> Map:
    """The verdicts by their numbers, and the differences as texts."""
    kinds = np.full((len(conditions), len(orders)), np.nan)
    texts = [[""] * len(orders) for _ in conditions]
    for line, condition in enumerate(conditions):
        for column, order in enumerate(orders):
            if standing := order.standings.get(condition):
                texts[line][column] = signed(standing.difference)
                if verdict := order.verdict(condition):
                    kinds[line, column] = [*_COLOURS].index(verdict)
    return Map(measure, kinds, texts)
