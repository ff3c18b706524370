"""The figure of the Euro NCAP tests: a map of the score of every test at every speed."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from care_sim.base.errors import counted, percent
from care_sim.core.arrays import Floats
from care_sim.evaluation.ncap_score import BEST_SCORE
from care_sim.reports.figures.maps import Map, maps_figure
from care_sim.reports.ncap import Contender, NcapRows
from care_sim.study.run_config import Row

NCAP_FIGURE = "ncap"


def ncap_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """A map for every policy and budget, tests downwards, speeds to the right: the mean score, from
    red (hit as if nobody braked) to blue (avoided).
    """
    results = NcapRows(rows)
    contenders = [
        [results.contender(policy, budget) for policy in results.policies]
        for budget in results.budgets or [1.0]
    ]
    seeds = counted(len({row["seed"] for row in rows}), "seed")
    figure = maps_figure(
        f"mean score of {seeds} by test and speed (km/h); empty: no test at this speed",
        [[_map(results, contender) for contender in line] for line in contenders],
        [line.label for line in results.lines],
        [f"{speed:g}" for speed in results.speeds],
        "reported, unreported: whether perception knows the cars that hide the target",
        "score (5 avoided, 0 hit at full speed)",
        # A palette whose ends the colour-blind tell apart.
        cmap="RdYlBu",
        vmin=0.0,
        vmax=BEST_SCORE,
    )
    for axes in figure.axes:
        axes.tick_params(axis="x", labelrotation=90)
    return {NCAP_FIGURE: figure}


def _map(results: NcapRows, contender: Contender) -> Map:
    """The mean score of every test at every speed."""
    sums = np.zeros((2, len(results.lines), len(results.speeds)))
    for (_, (line, speed, _)), value in results.scores(contender, results.lines).items():
        place = results.lines.index(line), results.speeds.index(speed)
        sums[0][place] += value
        sums[1][place] += 1
    means: Floats = np.full(sums.shape[1:], np.nan)
    np.divide(sums[0], sums[1], out=means, where=sums[1] > 0)
    return Map(f"{results.marked(contender[0])}, {percent(contender[1])}", means)
