"""The figure of the cut-ins of UN Regulation 157: gap against relative speed, where a careful human
prevents, and what every policy avoids.
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from care_sim.base.errors import percent
from care_sim.core.arrays import Floats
from care_sim.reports.figures.styles import INK
from care_sim.reports.formatting import marked
from care_sim.reports.tables.r157 import cut_in_rows
from care_sim.scenarios.r157.grid import EGO_KPH, LATERAL_MPS, CutInCase
from care_sim.scenarios.r157.preventable import PREVENTABLE, verdicts
from care_sim.study.designs.r157 import case_of
from care_sim.study.rows.reading import is_avoided
from care_sim.study.run_config import FULL, Row

R157_FIGURE = "r157-avoided"
_COLOURS = "cividis"
_LINE_KPH = np.linspace(5.0, 52.0, 48)
_LINE_GAPS_M = np.arange(0.25, 65.0, 0.25)


def r157_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Share of the preventable cases avoided, one row of panels per budget and one panel per
    policy; each dot is a relative speed and a gap, whatever the other speeds.
    """
    study = cut_in_rows(rows)
    policies = study.policies
    size = (1.2 + 2.1 * len(policies), 1.0 + 2.3 * len(study.budgets))
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(
        len(study.budgets), len(policies), squeeze=False, sharex=True, sharey=True
    )
    boundaries = {
        (mps, style): boundary_m(_LINE_KPH, mps)
        for mps, style in ((LATERAL_MPS[0], "-"), (LATERAL_MPS[-1], ":"))
    }
    for line, budget in zip(panels, study.budgets, strict=True):
        for axes, policy in zip(line, policies, strict=True):
            own = "every cell" if policy == FULL else percent(budget)
            axes.set_title(f"{marked(policy, study.tags[policy])}, {own}", loc="left", fontsize=9)
            for (mps, style), gaps in boundaries.items():
                label = f"a careful human prevents above, car at {mps:g} m/s across"
                axes.plot(_LINE_KPH, gaps, style, color=INK, linewidth=1, label=label)
            _draw(axes, study.of(policy, budget))
    for axes in panels[-1]:
        axes.set_xlabel("relative speed (km/h)", fontsize=8)
    for axes in panels[:, 0]:
        axes.set_ylabel("gap (m)", fontsize=8)
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    shares = ScalarMappable(Normalize(0, 100), _COLOURS)
    figure.colorbar(shares, ax=panels, label="preventable cases avoided (%)", shrink=0.8)
    return {R157_FIGURE: figure}


def _draw(axes: Axes, rows: Sequence[Row]) -> None:
    met: dict[tuple[float, float], list[bool]] = {}
    for row in rows:
        case = case_of(row)
        met.setdefault((case.relative_kph, case.gap_m), []).append(is_avoided(row))
    axes.scatter(
        [relative for relative, _ in met],
        [gap for _, gap in met],
        c=[100 * float(np.mean(avoided)) for avoided in met.values()],
        cmap=_COLOURS,
        vmin=0,
        vmax=100,
        s=24,
        edgecolors=INK,
        linewidths=0.4,
    )
    axes.grid(axis="x")


def boundary_m(relative_kph: Floats, lateral_mps: float) -> Floats:
    """(n,) the least gap, m, from which on the careful human prevents the cut-in of a car, at
    relative speeds (n,) in km/h and a lateral speed in m/s; nan where it prevents none.
    """
    # The ego's own speed plays no part in it.
    least = np.full(len(relative_kph), np.nan)
    for number, relative in enumerate(relative_kph):
        cases = [CutInCase(EGO_KPH[-1], relative, gap, lateral_mps) for gap in _LINE_GAPS_M]
        prevented = [word == PREVENTABLE for word in verdicts(cases)]
        if any(prevented):
            least[number] = _LINE_GAPS_M[prevented.index(True)]
    return least
