"""The figure of the Euro NCAP tests: a map of the score of every test at every speed."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from care_sim.base.errors import counted, percent
from care_sim.core.arrays import Floats
from care_sim.evaluation.ncap_score import BEST_SCORE
from care_sim.reports.ncap import Contender, NcapRows
from care_sim.study.run_config import Row

NCAP_FIGURE = "ncap"


def ncap_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """The map, by name."""
    return {NCAP_FIGURE: ncap_figure(rows)}


def ncap_figure(rows: Sequence[Row]) -> Figure:
    """A panel for every policy and budget, tests downwards, speeds to the right: the mean score,
    from red (hit as if nobody braked) to blue (avoided).
    """
    results = NcapRows(rows)
    budgets = results.budgets or [1.0]
    speeds = results.speeds
    width = 2.2 + (0.5 + 0.16 * len(speeds)) * len(results.policies)
    height = 1.1 + (0.5 + 0.16 * len(results.lines)) * len(budgets)
    figure = Figure(figsize=(max(width, 7.0), height), layout="constrained")
    panels = figure.subplots(
        len(budgets), len(results.policies), sharex=True, sharey=True, squeeze=False
    )
    for line, budget in zip(panels, budgets, strict=True):
        for axes, policy in zip(line, results.policies, strict=True):
            contender = results.contender(policy, budget)
            image = _draw(axes, results, contender, speeds)
            axes.set_title(
                f"{results.marked(policy)}, {percent(contender[1])}", loc="left", fontsize=7
            )
    _name_axes([*panels[:, 0]], results, speeds)
    for axes in panels[-1]:
        axes.tick_params(axis="x", labelrotation=90)
        axes.set_xlabel("test speed (km/h)", fontsize=7)
    seeds = counted(len({row["seed"] for row in rows}), "seed")
    title = f"mean score of {seeds}; pale: no test at this speed"
    figure.suptitle(title, x=0.01, ha="left", fontsize=8)
    note = "reported, unreported: whether perception knows the cars that hide the target"
    figure.supxlabel(note, fontsize=7)
    bar = figure.colorbar(image, ax=panels, fraction=0.02, pad=0.01)
    bar.set_label("score (5 avoided, 0 hit at full speed)", fontsize=7)
    bar.ax.tick_params(labelsize=7)
    return figure


def _draw(
    axes: Axes, results: NcapRows, contender: Contender, speeds: Sequence[float]
) -> AxesImage:
    """The mean score of every test at every speed; nothing where it was not played."""
    sums = np.zeros((2, len(results.lines), len(speeds)))
    for (_, (line, speed, _)), value in results.scores(contender, results.lines).items():
        place = results.lines.index(line), speeds.index(speed)
        sums[0][place] += value
        sums[1][place] += 1
    means: Floats = np.full(sums.shape[1:], np.nan)
    np.divide(sums[0], sums[1], out=means, where=sums[1] > 0)
    axes.set_facecolor("0.94")
    axes.tick_params(length=0, labelsize=6)
    axes.spines[:].set_visible(False)
    # A palette whose ends the colour-blind tell apart.
    return axes.imshow(means, cmap="RdYlBu", vmin=0.0, vmax=BEST_SCORE, aspect="auto")


def _name_axes(first: Sequence[Axes], results: NcapRows, speeds: Sequence[float]) -> None:
    """Names of tests beside the first panels; every speed below, upright since they are narrow."""
    for axes in first:
        axes.set_yticks(range(len(results.lines)), [line.label for line in results.lines])
    first[0].set_xticks(range(len(speeds)), [f"{speed:g}" for speed in speeds])
