"""The charts of the first-sighting protocol: the paper's Figures 2 and 3, and the policies over the
best control.
"""

from collections.abc import Sequence
from typing import Any

import altair as alt

from care_sim.base.errors import percent
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL, Ratio
from care_sim.reports.figures.protocol import Point, frontier, recalls
from care_sim.reports.figures.styles import APART, OPEN_LOOP_DODGE
from care_sim.reports.formatting import MARKS, marked, tag_notes
from care_sim.reports.page.chart import (
    FULL_SCAN,
    PANEL_WIDTH,
    Chart,
    Encoding,
    budget_axis,
    faceted,
    specification,
)
from care_sim.reports.page.control_charts import control_chart
from care_sim.reports.protocol.controls import over_controls
from care_sim.reports.protocol.formatting import share_with_ends
from care_sim.reports.protocol.paper import published_level
from care_sim.reports.protocol.rows import SettingPlays, plays_by_setting
from care_sim.study.run_config import FULL, Row

_RECALLS = (FIRST_SIGHTING, OVERALL)
_Values = list[dict[str, Any]]


def protocol_charts(rows: Sequence[Row]) -> list[Chart]:
    """Figures 2 and 3 of the paper for each setting, and what policies have over controls where any
    was played; Figure 3 needs two budgets.
    """
    charts = []
    for plays in plays_by_setting(rows):
        if plays.policies:
            charts.append(_pareto(plays))
        if len(plays.budgets) > 1:
            charts.append(_levels(plays))
        if measures := over_controls(plays):
            charts.append(control_chart(plays, measures))
    return charts


def _pareto(plays: SettingPlays) -> Chart:
    """First-sighting against overall recall, one panel per budget, and the frontier of what a car
    can have.
    """
    encoding = Encoding.of(plays.tags.items(), full=False)
    values = [value for budget in plays.budgets for value in _points(plays, budget)]
    chart = (
        faceted(_pareto_panel(encoding), values, [*map(_panel, plays.budgets)])
        .resolve_scale(x="independent", y="independent")
        .add_params(encoding.chosen)
    )
    ceiling = recalls(plays, FULL, 1.0) if plays.full else None
    reached = (
        [f"Full scan: {ceiling[1]:.1f}% of first sightings, {ceiling[0]:.1f}% overall."]
        if ceiling
        else []
    )
    notes = (
        "Grey line: Pareto frontier of the policies that a car can have.",
        *reached,
        *tag_notes(plays.tags.values()),
    )
    description = (
        "First-sighting recall against overall recall in percent, one panel per budget, one marker "
        "per policy."
    )
    return Chart(
        f"{plays.title}: first sightings against all", description, notes, specification(chart)
    )


def _pareto_panel(encoding: Encoding) -> Any:
    """One panel: the frontier as a line, and over it the policies as markers."""
    about = [
        alt.Tooltip("overall:Q", format=".1f"),
        alt.Tooltip("first:Q", format=".1f", title="first sightings"),
    ]
    place = {
        "x": alt.X(
            "overall:Q", title="overall recall (%)", scale=alt.Scale(zero=False, padding=12)
        ),
        "y": alt.Y(
            "first:Q", title="first-sighting recall (%)", scale=alt.Scale(zero=False, padding=12)
        ),
    }
    # From a corner the frontier goes down first and then on, hence the step before the point.
    line = (
        alt.Chart()
        .mark_line(color="#999999", interpolate="step-before")
        .encode(**place, order="order:Q")
    )
    points = (
        alt.Chart()
        .mark_point(size=90, strokeWidth=2)
        .encode(
            **place,
            color=encoding.colour,
            shape=encoding.shape,
            opacity=encoding.opacity,
            tooltip=["policy:N", *about],
        )
    )
    # Both are in one list of values: corners of the line have no policy.
    return alt.layer(
        line.transform_filter("datum.policy == null"),
        points.transform_filter("datum.policy != null"),
    ).properties(width=PANEL_WIDTH + 20, height=220)


def _points(plays: SettingPlays, budget: float) -> _Values:
    """The policies at a budget; then the corners of the frontier, without a policy."""
    points = {
        policy: point for policy in plays.policies if (point := recalls(plays, policy, budget))
    }
    possible = {
        policy: point for policy, point in points.items() if not {*plays.tags[policy]} & {*MARKS}
    }
    # The frontier ends at the least recall shown, so that its staircase reaches both edges of the
    # points.
    corners = [possible[policy] for policy in frontier(possible)]
    if corners:
        least = [min(point[axis] for point in points.values()) for axis in (0, 1)]
        corners = [(least[0], corners[0][1]), *corners, (corners[-1][0], least[1])]
    named: list[tuple[str | None, Point]] = [
        (marked(p, plays.tags[p]), point) for p, point in points.items()
    ]
    return [
        {
            "panel": _panel(budget),
            "policy": policy,
            "overall": overall,
            "first": first,
            "order": order,
        }
        for order, (policy, (overall, first)) in enumerate(
            [*named, *((None, corner) for corner in corners)]
        )
    ]


def _levels(plays: SettingPlays) -> Chart:
    """Both recalls against the budget; hollow: what the paper gives."""
    encoding = Encoding.of(plays.tags.items(), full=bool(plays.full))
    values = [value for ratio in _RECALLS for value in _curves(plays, ratio)]
    chart = faceted(
        _levels_panel(encoding, plays.budgets), values, [ratio.name for ratio in _RECALLS]
    ).resolve_scale(y="independent")
    said = (
        ["Hollow: what the paper gives."] if any(value["by"] == "paper" for value in values) else []
    )
    notes = (*said, f"{APART[0].upper()}{APART[1:]}.", *tag_notes(plays.tags.values()))
    description = (
        "First-sighting and overall recall in percent against the budget, a curve a policy."
    )
    return Chart(
        f"{plays.title}: recall against the budget",
        description,
        notes,
        specification(chart.add_params(encoding.chosen)),
    )


def _levels_panel(encoding: Encoding, budgets: Sequence[float]) -> Any:
    """One panel: the full scan as a rule, our levels as curves, the paper's as hollow points."""
    height = alt.Y("value:Q", title="recall (%)", scale=alt.Scale(zero=False))
    base = alt.Chart().encode(y=height, color=encoding.colour, opacity=encoding.opacity)
    curves = base.encode(x=budget_axis(budgets))
    about = [
        "policy:N",
        "budget:N",
        alt.Tooltip("value:Q", format=".1f", title="recall (%)"),
        alt.Tooltip("of_full:N", title="in % of the full scan's"),
        "by:N",
    ]
    # The full scan has no place on the axis of budgets and is drawn as a rule across it.
    ours, papers = (f"datum.place != null && datum.by == '{by}'" for by in ("here", "paper"))
    return alt.layer(
        base.mark_rule(strokeWidth=1.5, strokeDash=[5, 3]).transform_filter("datum.place == null"),
        curves.mark_line(strokeWidth=1.8).encode(strokeDash=encoding.dash).transform_filter(ours),
        curves.mark_point(filled=True, size=50)
        .encode(shape=encoding.shape, tooltip=about)
        .transform_filter(ours),
        curves.mark_point(filled=False, size=60)
        .encode(shape=encoding.shape, tooltip=about)
        .transform_filter(papers),
    ).properties(width=PANEL_WIDTH + 140, height=260)


def _curves(plays: SettingPlays, ratio: Ratio) -> _Values:
    """Our levels, moved apart, and the paper's; without a place the full scan."""
    values: _Values = []
    for number, (policy, tags) in enumerate(plays.tags.items()):
        shift = OPEN_LOOP_DODGE.factor(number, len(plays.tags))
        for budget in plays.budgets:
            about = {
                "policy": marked(policy, tags),
                "budget": percent(budget),
                "panel": ratio.name,
                "of_full": "",
            }
            here = plays.level(ratio, policy, budget).by_event
            if here is not None:
                of_full = share_with_ends(plays.share_of_full(ratio, policy, budget))
                values.append(
                    about
                    | {"place": budget * shift, "value": here, "by": "here", "of_full": of_full}
                )
            # The paper's stand at their own budgets, and belong to its plain setting alone.
            plain = plays.setting.as_in_paper
            said = published_level(ratio, policy, budget) if plain else None
            if said is not None:
                values.append(about | {"place": budget, "value": said, "by": "paper"})
    ceiling = plays.level(ratio, FULL, 1.0).by_event if plays.full else None
    full = {
        "policy": FULL_SCAN,
        "budget": "100%",
        "panel": ratio.name,
        "place": None,
        "value": ceiling,
        "by": "here",
        "of_full": "100",
    }
    return [*values, *([full] if ceiling is not None else [])]


def _panel(budget: float) -> str:
    return f"budget {percent(budget)}"
