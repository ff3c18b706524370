"""Figures of the first-sighting protocol: levels against the budget, the paper's Figure 3, and what
policies have over the best control.
"""

from collections.abc import Sequence

from matplotlib.figure import Figure

from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL, Ratio
from care_sim.reports.engine.controls import BEST_CONTROL
from care_sim.reports.figures.curves import FULL_SCAN, Panel, curves_figure
from care_sim.reports.protocol.controls import OverControl, named_controls, over_controls
from care_sim.reports.protocol.paper import published_level
from care_sim.reports.protocol.rows import SettingPlays, plays_by_setting
from care_sim.study.run_config import FULL, Row

PROTOCOL_FIGURES = tuple(
    f"{kind}-{{world}}{rest}" for kind in ("pareto", "levels", "controls") for rest in ("", "-*")
)
"""Every figure that a folder may hold of a source, as patterns: behind the source stands what is
not usual in detector and conditions. Earlier versions drew `pareto`, which is removed.
"""
_UNIT = "budget (share of cells fired)"


def protocol_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Levels for each setting that has two budgets, by name, and what policies have over controls
    where any was played.
    """
    figures = {}
    for plays in plays_by_setting(rows):
        # A single budget makes no curve.
        if len(plays.budgets) > 1:
            figures[f"levels-{plays.setting.slug}"] = levels_figure(plays)
        if measures := over_controls(plays):
            figures[f"controls-{plays.setting.slug}"] = control_figure(plays, measures)
    return figures


def levels_figure(plays: SettingPlays) -> Figure:
    """Recalls in % of all policies at all budgets, and those that the paper gives of its plain
    setting.
    """
    panels = [_levels(plays, ratio) for ratio in (FIRST_SIGHTING, OVERALL)]
    return curves_figure(plays.title, panels, plays.tags, [_UNIT], from_zero=False)


def _levels(plays: SettingPlays, ratio: Ratio) -> Panel:
    full = plays.level(ratio, FULL, 1.0).by_event if plays.full else None
    said = {
        name: [published_level(ratio, policy, budget) for budget in budgets]
        for name, policy, budgets in (
            (FULL_SCAN, FULL, [1.0]),
            *((policy, policy, plays.budgets) for policy in plays.policies),
        )
        if plays.setting.as_in_paper
    }
    return Panel.by_budget(
        "",
        plays.budgets,
        label=f"{ratio.name} (%)",
        lines={} if full is None else {FULL_SCAN: full},
        heights={
            policy: [plays.level(ratio, policy, budget).by_event for budget in plays.budgets]
            for policy in plays.policies
        },
        paper={name: own for name, own in said.items() if {*own} != {None}},
    )


def control_figure(plays: SettingPlays, measures: Sequence[OverControl]) -> Figure:
    """A panel a measure (of which there must be one): every other policy less the best control, in
    points.
    """
    panels = [
        Panel.by_budget(
            measure.ratio.name,
            plays.budgets,
            label=f"points over the {BEST_CONTROL}",
            lines={BEST_CONTROL: 0.0},
            heights={
                policy: [each.mean if each else None for each in own]
                for policy, own in measure.differences.items()
            },
            ends={
                policy: [
                    (ends.low, ends.high) if each and (ends := each.interval) else None
                    for each in own
                ]
                for policy, own in measure.differences.items()
            },
        )
        for measure in measures
    ]
    tags = {policy: plays.tags[policy] for policy in measures[0].differences}
    notes = [_UNIT, named_controls(plays, measures)]
    return curves_figure(plays.title, panels, tags, notes, bars="95% intervals")
