"""The figure of the crowding study: how much later all-camera detects than CARE, by vehicles and
budget.
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from care_sim.base.errors import counted, percent
from care_sim.reports.contrasts import GATE_M
from care_sim.reports.figures.maps import Map, maps_figure
from care_sim.reports.figures.styles import INK
from care_sim.reports.formatting import mean
from care_sim.reports.tables.crowding import COLLAPSE_M, Crowd
from care_sim.study.run_config import Row

CROWDING_FIGURE = "crowding"
_NOTE = (
    f"bold: the interval excludes 0; asterisk: and at least {GATE_M} m; frame: all-camera "
    "collapsed; ≤: at most, where all-camera missed somebody; ~: where both did"
)


def crowding_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Mean paired difference in first detection, all-camera minus CARE, in metres: one number per
    cell.
    """
    crowd = Crowd(rows)
    counts = crowd.counts[::-1]
    gaps = [[crowd.gap(n, budget) for budget in crowd.budgets] for n in counts]
    values = np.array([[np.nan if gap is None else gap.mean for gap in line] for line in gaps])
    # Symmetric about zero, so that the sign of a difference is its colour. At least as wide as a
    # collapse, so that small differences look small.
    widest = max(float(np.nanmax(np.abs(values), initial=0.0)), COLLAPSE_M)
    seeds = counted(len({row["seed"] for row in rows}), "seed")
    figure = maps_figure(
        f"dense, {seeds}: first detection of all-camera minus care (m)",
        [[Map("", values, [[*map(mean, line)] for line in gaps])]],
        [*map(str, counts)],
        [*map(percent, crowd.budgets)],
        _NOTE,
        cmap="PuOr",
        vmin=-widest,
        vmax=widest,
    )
    (axes,) = figure.axes
    axes.set(xlabel="budget (share of cells fired)", ylabel="standing vehicles")
    for column, budget in enumerate(crowd.budgets):
        for vehicles in crowd.collapsed(budget):
            # Cells of a map are centred on whole numbers.
            corner = column - 0.5, counts.index(vehicles) - 0.5
            axes.add_patch(Rectangle(corner, 1.0, 1.0, fill=False, edgecolor=INK, linewidth=1.4))
    return {CROWDING_FIGURE: figure}
