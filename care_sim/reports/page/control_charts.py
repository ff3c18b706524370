"""The chart of what every policy has over the best control, in points of recall by budget."""

from collections.abc import Sequence
from typing import Any

import altair as alt

from care_sim.base.errors import percent
from care_sim.reports.controls import BEST_CONTROL
from care_sim.reports.figures.styles import OPEN_LOOP_DODGE, styles
from care_sim.reports.formatting import interval, marked, tag_notes
from care_sim.reports.page.chart import (
    PANEL_WIDTH,
    Chart,
    Encoding,
    budget_axis,
    faceted,
    specification,
)
from care_sim.reports.protocol.controls import RULE, OverControl, named_controls
from care_sim.reports.protocol.rows import SettingPlays


def control_chart(plays: SettingPlays, measures: Sequence[OverControl]) -> Chart:
    """A panel a measure (of which there must be one): every other policy less the best control."""
    tags = {policy: plays.tags[policy] for policy in measures[0].differences}
    # The styles of all policies, so that each looks as it does in the other charts.
    drawn = styles(plays.tags.items())
    encoding = Encoding.of_styles({marked(policy, tags[policy]): drawn[policy] for policy in tags})
    values = [value for measure in measures for value in _points(plays, measure)]
    chart = faceted(
        _panel(encoding, plays.budgets), values, [measure.ratio.name for measure in measures]
    ).resolve_scale(y="independent")
    return Chart(
        f"{plays.title}: each policy over the {BEST_CONTROL}",
        f"Points of recall over the {BEST_CONTROL} by budget, a curve a policy.",
        (
            f"{named_controls(plays, measures)} {RULE} Bars: 95% intervals.",
            *tag_notes(tags.values()),
        ),
        specification(chart.add_params(encoding.chosen)),
    )


def _panel(encoding: Encoding, budgets: Sequence[float]) -> Any:
    """One panel: the control as a rule at zero, the policies as curves with their intervals."""
    height = alt.Y("value:Q", title=f"points over the {BEST_CONTROL}")
    base = alt.Chart().encode(
        x=budget_axis(budgets), color=encoding.colour, opacity=encoding.opacity
    )
    about = ["policy:N", "budget:N", "control:N", alt.Tooltip("text:N", title="points")]
    return alt.layer(
        alt.Chart().mark_rule(color="#555555", strokeDash=[5, 3]).encode(y=alt.datum(0)),
        base.mark_rule(strokeWidth=1.5).encode(y="low:Q", y2="high:Q"),
        base.mark_line(strokeWidth=1.8).encode(y=height, strokeDash=encoding.dash),
        base.mark_point(filled=True, size=50).encode(y=height, shape=encoding.shape, tooltip=about),
    ).properties(width=PANEL_WIDTH + 140, height=260)


def _points(plays: SettingPlays, measure: OverControl) -> list[dict[str, Any]]:
    """What every other policy has over the control at every budget, moved apart."""
    values = []
    for number, (policy, differences) in enumerate(measure.differences.items()):
        shift = OPEN_LOOP_DODGE.factor(number, len(measure.differences))
        at_budgets = zip(plays.budgets, measure.controls, differences, strict=True)
        for budget, control, difference in at_budgets:
            if difference is None:
                continue
            ends = difference.interval
            values.append(
                {
                    "panel": measure.ratio.name,
                    "policy": marked(policy, plays.tags[policy]),
                    "budget": percent(budget),
                    "control": control,
                    "place": budget * shift,
                    "value": difference.mean,
                    "low": ends.low if ends else None,
                    "high": ends.high if ends else None,
                    "text": interval(difference),
                }
            )
    return values
