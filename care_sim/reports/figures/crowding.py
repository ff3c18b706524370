"""The figure of the crowding study: how much later all-camera detects than CARE, by vehicles and
budget.
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from care_sim.base.errors import counted, percent
from care_sim.reports.contrasts import GATE_M
from care_sim.reports.formatting import mean
from care_sim.reports.table import Bold
from care_sim.reports.tables.crowding import COLLAPSE_M, Crowd
from care_sim.study.run_config import Row

CROWDING_FIGURE = "crowding"
PALE = 0.55
"""Share of the range of colours up to which numbers are printed in black."""


def crowding_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """The heat map, by name."""
    return {CROWDING_FIGURE: crowding_figure(rows)}


def crowding_figure(rows: Sequence[Row]) -> Figure:
    """Mean paired difference in first detection, all-camera minus CARE, in metres: one number per
    cell.

    Bold where the interval excludes zero, an asterisk where the gate is met too, a frame where all-
    camera has collapsed.
    """
    crowd = Crowd(rows)
    size = max(1.6 + 0.8 * len(crowd.budgets), 6.0), 1.5 + 0.34 * len(crowd.counts)
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.add_subplot()
    gaps = [[crowd.gap(n, budget) for budget in crowd.budgets] for n in crowd.counts]
    values = np.array([[np.nan if gap is None else gap.mean for gap in line] for line in gaps])
    # Symmetric about zero, so that the sign of a difference is its colour. At least as wide as a
    # collapse, so that small differences look small.
    widest = max(float(np.nanmax(np.abs(values), initial=0.0)), COLLAPSE_M)
    image = axes.imshow(
        values, cmap="PuOr", vmin=-widest, vmax=widest, aspect="auto", origin="lower"
    )
    for (row, column), value in np.ndenumerate(values):
        text = mean(gaps[row][column])
        # Written this way round, nan is pale: a cell that was not played has no colour.
        pale = not abs(value) > PALE * widest
        weight = "bold" if isinstance(text, Bold) else "normal"
        axes.text(
            column,
            row,
            text,
            ha="center",
            va="center",
            size=8,
            weight=weight,
            color="black" if pale else "white",
        )
    _frame_collapses(axes, crowd)
    _finish(axes, crowd)
    figure.colorbar(image, label="all-camera minus care, first detection (m)")
    return figure


def _frame_collapses(axes: Axes, crowd: Crowd) -> None:
    for column, budget in enumerate(crowd.budgets):
        for vehicles in crowd.collapsed(budget):
            # Pictures of a matrix have their cells centred on whole numbers.
            corner = (column - 0.5, crowd.counts.index(vehicles) - 0.5)
            axes.add_patch(
                Rectangle(corner, 1.0, 1.0, fill=False, edgecolor="black", linewidth=1.2)
            )


def _finish(axes: Axes, crowd: Crowd) -> None:
    axes.set_xticks(range(len(crowd.budgets)), [percent(budget) for budget in crowd.budgets])
    axes.set_yticks(range(len(crowd.counts)), [str(n) for n in crowd.counts])
    axes.set_xlabel("budget (share of cells fired)")
    axes.set_ylabel("standing vehicles")
    seeds = counted(len({row["seed"] for row in crowd.study.rows}), "seed")
    title = (
        f"dense, {seeds}. Bold: interval without zero; asterisk: and at least {GATE_M} m\n"
        "frame: all-camera collapsed; ≤: at most, where it never detected somebody; ~: where both "
        "did not"
    )
    axes.set_title(title, loc="left", fontsize=8)
    axes.tick_params(length=0)
