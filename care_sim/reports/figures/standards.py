"""Figures of the standard tests: maps of what every policy avoids in the Euro NCAP tests and in the
cut-ins of UN Regulation 157.
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from care_sim.base.errors import counted, percent
from care_sim.core.arrays import Floats
from care_sim.evaluation.ncap_score import BEST_SCORE
from care_sim.reports.figures.maps import Map, maps_figure
from care_sim.reports.formatting import marked
from care_sim.reports.tables.ncap import Contender, NcapRows
from care_sim.reports.tables.r157 import cut_in_rows
from care_sim.study.designs.r157 import case_of
from care_sim.study.rows.reading import is_avoided
from care_sim.study.run_config import FULL, Row

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


R157_FIGURE = "r157-avoided"


def r157_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Share of the preventable cases avoided, one row of maps per budget and one map per policy;
    each cell is a relative speed and a gap, whatever the other speeds.
    """
    study = cut_in_rows(rows)
    cases = [case_of(row) for row in rows]
    gaps = sorted({case.gap_m for case in cases}, reverse=True)
    speeds = sorted({case.relative_kph for case in cases})

    def map_of(policy: str, budget: float) -> Map:
        avoided: dict[tuple[float, float], list[bool]] = {}
        for row in study.of(policy, budget):
            case = case_of(row)
            avoided.setdefault((case.gap_m, case.relative_kph), []).append(is_avoided(row))
        shares = [
            [100 * float(np.mean(avoided.get((gap, speed), np.nan))) for speed in speeds]
            for gap in gaps
        ]
        own = "every cell" if policy == FULL else percent(budget)
        return Map(f"{marked(policy, study.tags[policy])}, {own}", np.array(shares))

    figure = maps_figure(
        "gap (m) by relative speed (km/h); empty: no case that a careful human prevents",
        [[map_of(policy, budget) for policy in study.policies] for budget in study.budgets],
        [f"{gap:g}" for gap in gaps],
        [f"{speed:g}" for speed in speeds],
        unit="preventable cases avoided (%)",
        cmap="cividis",
        vmin=0,
        vmax=100,
    )
    return {R157_FIGURE: figure}
