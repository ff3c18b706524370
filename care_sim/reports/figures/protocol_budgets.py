"""The paper's Figure 3: first-sighting and overall recall against the budget, a line a policy."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from care_sim.base.errors import percent
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL, Ratio
from care_sim.reports.figures.styles import FULL as FULL_STYLE
from care_sim.reports.figures.styles import styles
from care_sim.reports.formatting import marked, tag_notes
from care_sim.reports.protocol.paper import published_level
from care_sim.reports.protocol.rows import SettingPlays
from care_sim.study.run_config import FULL, REFERENCE

DODGE = 0.025
"""Share of a budget by which neighbouring policies are moved apart, so that equal lines stay
visible.
"""
SPREAD = 0.1
"""The same share from the first policy to the last, at most."""
APART = "policies are drawn a little apart sideways, so that equal points stay visible"


def levels_figure(plays: SettingPlays) -> Figure:
    """Recalls in % of all policies at all budgets; the full scan as a dashed line; what the paper
    gives of both, hollow and dotted.
    """
    figure = Figure(figsize=(8.4, 4.0), layout="constrained")
    panels = figure.subplots(1, 2)
    for axes, ratio in zip(panels, (FIRST_SIGHTING, OVERALL), strict=True):
        _draw(axes, plays, ratio)
        if not plays.setting.conditions:
            _draw_published(axes, plays, ratio)
        axes.set_xscale("log")
        axes.set_xticks(plays.budgets, [percent(budget) for budget in plays.budgets])
        axes.minorticks_off()
        axes.set_ylabel(f"{ratio.name} (%)")
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(axis="y", color="0.93")
        axes.set_axisbelow(True)
    figure.suptitle(
        f"{plays.setting.label}: {len(plays.scenes)} scenes", x=0.01, ha="left", fontsize=10
    )
    apart = [APART] if len(plays.tags) > 1 else []
    notes = ["budget (share of cells fired)", *apart, *tag_notes(plays.tags.values())]
    figure.supxlabel("\n".join(notes), fontsize=9)
    figure.legend(
        *panels[1].get_legend_handles_labels(), loc="outside right upper", frameon=False, fontsize=9
    )
    return figure


def _draw(axes: Axes, plays: SettingPlays, ratio: Ratio) -> None:
    ceiling = plays.level(ratio, FULL, 1.0).by_event if plays.full else None
    if ceiling is not None:
        axes.axhline(
            ceiling,
            color=FULL_STYLE.colour,
            linestyle=FULL_STYLE.line,
            linewidth=1.2,
            label="full scan",
        )
    for number, (policy, look) in enumerate(styles(plays.tags.items()).items()):
        shift = 1 + min(DODGE, SPREAD / len(plays.tags)) * (number - (len(plays.tags) - 1) / 2)
        levels = {budget: plays.level(ratio, policy, budget).by_event for budget in plays.budgets}
        known = {budget * shift: value for budget, value in levels.items() if value is not None}
        order = 4 if policy == REFERENCE else 3
        line = axes.plot(
            list(known),
            list(known.values()),
            look.line,
            color=look.colour,
            zorder=order,
            linewidth=1.4,
        )
        line[0].set(marker=look.marker, markersize=6, markeredgecolor="white", markeredgewidth=0.5)
        line[0].set_label(marked(policy, plays.tags[policy]))


def _draw_published(axes: Axes, plays: SettingPlays, ratio: Ratio) -> None:
    """The levels that the paper gives, of nuScenes and its own detectors."""
    ceiling = published_level(ratio, FULL, 1.0)
    if ceiling is not None:
        axes.axhline(
            ceiling, color=FULL_STYLE.colour, linestyle=":", linewidth=1.2, label="paper: full scan"
        )
    for policy, look in styles(plays.tags.items()).items():
        levels = {budget: published_level(ratio, policy, budget) for budget in plays.budgets}
        known = {budget: value for budget, value in levels.items() if value is not None}
        if known:
            (marks,) = axes.plot(
                list(known), list(known.values()), look.marker, color=look.colour, zorder=5
            )
            marks.set(
                markersize=7, markerfacecolor="white", markeredgewidth=1.4, label=f"paper: {policy}"
            )
