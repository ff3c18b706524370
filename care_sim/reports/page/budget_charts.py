"""The chart of a sweep: first detection against the budget, one curve per policy."""

from collections.abc import Sequence
from typing import Any

import altair as alt

from care_sim.base.errors import counted, percent
from care_sim.reports.cells import Cell, summarise
from care_sim.reports.figures.styles import CLOSED_LOOP_DODGE
from care_sim.reports.formatting import marked, spread, tag_notes
from care_sim.reports.page.chart import (
    FULL_SCAN,
    Chart,
    Encoding,
    budget_axis,
    budgets_text,
    inline,
    specification,
)
from care_sim.study.run_config import FULL, Row

_NOTES = (
    "Median over the seeds; bars are quartiles. Hollow, at the bottom: the median is an actor "
    "that was not detected. Curves are drawn a little apart sideways, so that equal ones stay "
    "visible.",
)


def budget_charts(rows: Sequence[Row]) -> list[Chart]:
    """A chart for every scenario that was run without further conditions at several budgets."""
    cells = [cell for cell in summarise(rows) if not cell.setting.conditions]
    scenarios = dict.fromkeys(cell.setting.world for cell in cells)
    by_scenario = [[cell for cell in cells if cell.setting.world == name] for name in scenarios]
    return [_chart(own) for own in by_scenario if len(_budgets(own)) > 1]


def _chart(cells: Sequence[Cell]) -> Chart:
    tags = dict.fromkeys((cell.policy, cell.tags) for cell in cells if cell.policy != FULL)
    full = [cell for cell in cells if cell.policy == FULL and cell.detection.median is not None]
    encoding = Encoding.of(tags, bool(full))
    budgets = _budgets(cells)
    values = _values(cells, [policy for policy, _ in tags])
    chart = _curves(encoding, values, budgets, full)
    scenario = cells[0].setting.world
    counts = sorted({cell.episodes for cell in cells})
    seeds = counted(counts[0], "seed") if len(counts) == 1 else f"{counts[0]} to {counts[-1]} seeds"
    title = f"{scenario}: first detection against the budget, {seeds} a point"
    about_it = (
        "Median distance of the first detection in metres, one curve per policy, "
        f"budgets {budgets_text(budgets)}."
    )
    return Chart(
        title, about_it, (*_NOTES, *tag_notes(own for _, own in tags)), specification(chart)
    )


def _curves(
    encoding: Encoding,
    values: Sequence[dict[str, Any]],
    budgets: Sequence[float],
    full: Sequence[Cell],
) -> Any:
    """Curves with quartiles and points, hollow points at the bottom, the full scan as a rule."""
    height = alt.Y("median:Q", title="first detection (m)", scale=alt.Scale(zero=True))
    base = alt.Chart(inline(values)).encode(
        x=budget_axis(budgets), y=height, color=encoding.colour, opacity=encoding.opacity
    )
    # Vega draws nothing at null. These points are put at the bottom, hollow.
    missed = base.transform_filter("datum.median == null").encode(y=alt.datum(0))
    about = [
        alt.Tooltip("policy:N"),
        alt.Tooltip("budget:N"),
        alt.Tooltip("text:N", title="first detection (m)"),
        alt.Tooltip("never:N", title="never detected"),
    ]
    layers: list[Any] = [
        base.mark_rule(strokeWidth=1.5)
        .encode(y="low:Q", y2="high:Q")
        .transform_filter("datum.median != null"),
        base.mark_line(strokeWidth=1.8).encode(strokeDash=encoding.dash),
        base.mark_point(filled=True, size=55).encode(shape=encoding.shape, tooltip=about),
        missed.mark_point(filled=False, size=55).encode(shape=encoding.shape, tooltip=about),
    ]
    if full:
        # One line is enough: the full scan has one cell in a scenario without conditions.
        line = [{"policy": FULL_SCAN, "median": cell.detection.median} for cell in full[:1]]
        rule = alt.Chart(inline(line)).mark_rule(strokeWidth=1.5, strokeDash=[5, 3])
        layers.append(rule.encode(y=height, color=encoding.colour, opacity=encoding.opacity))
    return alt.layer(*layers).add_params(encoding.chosen).properties(width="container", height=300)


def _values(cells: Sequence[Cell], policies: Sequence[str]) -> list[dict[str, Any]]:
    """The points of the policies. A median that is not detected is null, which breaks the line."""
    return [
        {
            "policy": marked(cell.policy, cell.tags),
            "budget": percent(cell.budget),
            "place": cell.budget
            * CLOSED_LOOP_DODGE.factor(policies.index(cell.policy), len(policies)),
            "median": cell.detection.median,
            "low": cell.detection.low or 0.0,
            "high": cell.detection.high or 0.0,
            "text": spread(cell.detection),
            "never": f"{cell.never}/{cell.met}",
        }
        for cell in cells
        if cell.policy in policies
    ]


def _budgets(cells: Sequence[Cell]) -> list[float]:
    return sorted({cell.budget for cell in cells if cell.policy != FULL})
