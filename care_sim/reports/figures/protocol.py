"""Figures of the first-sighting protocol, for every setting that has them."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from care_sim.reports.figures.protocol_budgets import levels_figure
from care_sim.reports.figures.protocol_frontier import pareto_figure
from care_sim.reports.protocol.rows import plays_by_setting
from care_sim.study.run_config import Row
from care_sim.study.settings import SOURCES

KINDS = ("pareto", "levels")
FIGURE_NAMES = tuple(
    f"{kind}-{source}{rest}" for kind in KINDS for source in SOURCES for rest in ("", "-*")
)
"""Every figure that a folder may hold, as patterns: the source, then what of detector and
conditions is not usual.
"""


def protocol_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Figures 2 and 3 of the paper for each setting, by name; Figure 3 needs two budgets."""
    figures = {}
    for plays in plays_by_setting(rows):
        if plays.policies:
            figures[f"pareto-{plays.setting.slug}"] = pareto_figure(plays)
        if len(plays.budgets) > 1:
            figures[f"levels-{plays.setting.slug}"] = levels_figure(plays)
    return figures
