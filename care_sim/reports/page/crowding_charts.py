"""The chart of the crowding study: how much later all-camera detects than CARE, by vehicles and
budget.
"""

from collections.abc import Sequence
from typing import Any

import altair as alt

from care_sim.base.errors import counted, percent
from care_sim.reports.figures.crowding import PALE
from care_sim.reports.formatting import interval, mean
from care_sim.reports.page.chart import Chart, inline, specification
from care_sim.reports.tables.crowding import COLLAPSE_M, Crowd
from care_sim.study.run_config import Row

_NOTES = (
    "Asterisk: the interval excludes zero and the gate is met. Frame: all-camera has collapsed.",
)


def crowding_charts(rows: Sequence[Row]) -> list[Chart]:
    """The heat map of mean paired differences in first detection, metres."""
    crowd = Crowd(rows)
    collapsed = {(n, budget) for budget in crowd.budgets for n in crowd.collapsed(budget)}
    gaps = {(n, budget): crowd.gap(n, budget) for n in crowd.counts for budget in crowd.budgets}
    values = [
        {
            "vehicles": n,
            "budget": percent(budget),
            "gap": gap.mean,
            "text": mean(gap),
            "interval": interval(gap),
            "collapsed": (n, budget) in collapsed,
        }
        for (n, budget), gap in gaps.items()
        if gap
    ]
    chart = _heat_map(crowd, values)
    seeds = counted(len({row["seed"] for row in rows}), "seed")
    title = f"dense: first detection of all-camera minus care, m, {seeds}"
    about_it = (
        "A heat map of the mean difference by budget and standing vehicles; negative where "
        "all-camera is later."
    )
    return [Chart(title, about_it, _NOTES, specification(chart))]


def _heat_map(crowd: Crowd, values: Sequence[dict[str, Any]]) -> Any:
    """One square per budget and number of vehicles, with its number; framed where collapsed."""
    # The same range of colours as in the figure, so that both look alike.
    widest = max([COLLAPSE_M, *(abs(value["gap"]) for value in values)])
    base = alt.Chart(inline(values)).encode(
        x=alt.X(
            "budget:O",
            sort=[*map(percent, crowd.budgets)],
            title="budget",
            axis=alt.Axis(labelAngle=0),
        ),
        y=alt.Y("vehicles:O", sort="descending", title="standing vehicles"),
    )
    about = [alt.Tooltip(f"{name}:N") for name in ("vehicles", "budget", "interval")]
    colour = alt.Color(
        "gap:Q",
        scale=alt.Scale(scheme="purpleorange", domain=[-widest, widest], reverse=True),
        legend=alt.Legend(title="all-camera minus care, m", orient="bottom"),
    )
    frame = alt.condition("datum.collapsed", alt.value("black"), alt.value("transparent"))
    # White numbers on dark colours, as in the figure.
    ink = alt.condition(f"abs(datum.gap) > {PALE * widest}", alt.value("white"), alt.value("black"))
    return alt.layer(
        base.mark_rect(strokeWidth=1.5).encode(color=colour, stroke=frame, tooltip=about),
        base.mark_text(fontSize=11).encode(text="text:N", color=ink, tooltip=about),
    ).properties(width="container", height=26 * len(crowd.counts))
