"""The figure of the cut-ins of UN Regulation 157: what every policy avoids, by gap and relative
speed.
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from care_sim.base.errors import percent
from care_sim.reports.figures.maps import Map, maps_figure
from care_sim.reports.formatting import marked
from care_sim.reports.tables.r157 import cut_in_rows
from care_sim.study.designs.r157 import case_of
from care_sim.study.rows.reading import is_avoided
from care_sim.study.run_config import FULL, Row

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
