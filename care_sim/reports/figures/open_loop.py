"""Curves of the open loop: recalls against the budget, the paper's Figure 3, what policies have
over the best control, and what the order of cells does.
"""

from collections.abc import Sequence

from matplotlib.figure import Figure

from care_sim.base.errors import counted, percent
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL, Ratio
from care_sim.reports.engine.controls import BEST_CONTROL
from care_sim.reports.figures.curves import BUDGET, Panel, Point, curves_figure, point
from care_sim.reports.protocol.contrasts import OverControl, named_controls, over_controls
from care_sim.reports.protocol.paper import published_level
from care_sim.reports.protocol.rows import SettingPlays, plays_by_setting
from care_sim.study.designs.firing import rows_by_order
from care_sim.study.run_config import FULL, Row


def protocol_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Levels for each setting that has two budgets, by name, and what policies have over controls
    where any was played.
    """
    figures: dict[str, Figure] = {}
    for plays in plays_by_setting(rows):
        # A single budget makes no curve.
        if len(plays.budgets) > 1:
            panels = [_levels(plays, ratio) for ratio in (FIRST_SIGHTING, OVERALL)]
            name = f"levels-{plays.setting.slug}"
            figures |= curves_figure(
                name, plays.title, panels, plays.tags, [BUDGET], from_zero=False
            )
        if measures := over_controls(plays):
            name = f"controls-{plays.setting.slug}"
            panels = [_over_control(plays, measure) for measure in measures]
            notes = [BUDGET, named_controls(plays, measures)]
            figures |= curves_figure(
                name, plays.title, panels, plays.tags, notes, bars="95% intervals"
            )
    return figures


def _levels(plays: SettingPlays, ratio: Ratio) -> Panel:
    """Recalls in % at all budgets, and those that the paper gives of its plain setting."""

    def published(policy: str, budget: float) -> Point | None:
        return point(published_level(ratio, policy, 1.0 if policy == FULL else budget))

    names = [*plays.policies, FULL] if plays.setting.as_in_paper else []
    return Panel.by_budget(
        "",
        [*plays.policies, FULL],
        plays.budgets,
        lambda policy, budget: point(plays.level(ratio, policy, budget).by_event),
        label=f"{ratio.name} (%)",
        paper=Panel.by_budget("", names, plays.budgets, published).curves,
    )


def _over_control(plays: SettingPlays, measure: OverControl) -> Panel:
    """Every other policy less the best control, in points."""
    differences = {
        policy: dict(zip(plays.budgets, own, strict=True))
        for policy, own in measure.differences.items()
    }

    def read(policy: str, budget: float) -> Point | None:
        if policy == BEST_CONTROL:
            return Point(0.0)
        found = differences[policy][budget]
        return Point(found.mean, found.interval and found.interval[1:]) if found else None

    return Panel.by_budget(
        measure.ratio.name,
        [BEST_CONTROL, *differences],
        plays.budgets,
        read,
        label=f"points over the {BEST_CONTROL}",
    )


def open_order_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """First-sighting recall in % by order of the cells inside a set, one panel per budget."""
    played = {order: plays_by_setting(own)[0] for order, own in rows_by_order(rows).items()}
    study = next(iter(played.values()))

    def panel(budget: float) -> Panel:
        def read(policy: str, plays: SettingPlays) -> Point | None:
            return point(plays.level(FIRST_SIGHTING, policy, budget).by_event)

        return Panel.of(f"budget {percent(budget)}", [*study.tags, FULL], played, read)

    label = f"{study.setting.label}, {counted(len(study.scenes), 'scene')}"
    title = f"order of the cells inside a set: first-sighting recall (%): {label}"
    panels = map(panel, study.budgets)
    return curves_figure("order-open-loop", title, panels, study.tags, columns=2, share=True)
