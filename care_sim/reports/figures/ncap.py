"""The figure of the Euro NCAP tests: a map of the score of every test at every speed."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from care_sim.base.errors import counted, percent
from care_sim.core.arrays import Floats
from care_sim.evaluation.ncap_score import BEST_SCORE
from care_sim.reports.figures.maps import draw_map
from care_sim.reports.ncap import Contender, NcapRows
from care_sim.study.run_config import Row

NCAP_FIGURE = "ncap"


def ncap_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """A panel for every policy and budget, tests downwards, speeds to the right: the mean score,
    from red (hit as if nobody braked) to blue (avoided).
    """
    results = NcapRows(rows)
    budgets, speeds, policies = results.budgets or [1.0], results.speeds, results.policies
    width = 2.2 + (0.5 + 0.16 * len(speeds)) * len(policies)
    height = 1.1 + (0.5 + 0.16 * len(results.lines)) * len(budgets)
    figure = Figure(figsize=(max(width, 7.0), height), layout="constrained")
    panels = figure.subplots(len(budgets), len(policies), sharex=True, sharey=True, squeeze=False)
    for row, budget in zip(panels, budgets, strict=True):
        for axes, policy in zip(row, policies, strict=True):
            contender = results.contender(policy, budget)
            image = draw_map(
                axes,
                _means(results, contender),
                [line.label for line in results.lines],
                [f"{speed:g}" for speed in speeds],
                # A palette whose ends the colour-blind tell apart.
                cmap="RdYlBu",
                vmin=0.0,
                vmax=BEST_SCORE,
            )
            title = f"{results.marked(policy)}, {percent(contender[1])}"
            axes.set_title(title, loc="left", fontsize=7)
    for axes in panels[-1]:
        axes.tick_params(axis="x", labelrotation=90)
        axes.set_xlabel("test speed (km/h)", fontsize=7)
    seeds = counted(len({row["seed"] for row in rows}), "seed")
    title = f"mean score of {seeds}; empty: no test at this speed"
    figure.suptitle(title, x=0.01, ha="left", fontsize=8)
    note = "reported, unreported: whether perception knows the cars that hide the target"
    figure.supxlabel(note, fontsize=7)
    bar = figure.colorbar(image, ax=panels, fraction=0.02, pad=0.01)
    bar.set_label("score (5 avoided, 0 hit at full speed)", fontsize=7)
    bar.ax.tick_params(labelsize=7)
    return {NCAP_FIGURE: figure}


def _means(results: NcapRows, contender: Contender) -> Floats:
    """(tests, speeds) the mean score of every test at every speed; nan where it was not played."""
    sums = np.zeros((2, len(results.lines), len(results.speeds)))
    for (_, (line, speed, _)), value in results.scores(contender, results.lines).items():
        place = results.lines.index(line), results.speeds.index(speed)
        sums[0][place] += value
        sums[1][place] += 1
    means: Floats = np.full(sums.shape[1:], np.nan)
    np.divide(sums[0], sums[1], out=means, where=sums[1] > 0)
    return means
