"""The paper's Figure 2: first-sighting against overall recall.

One panel per budget, one marker per policy.
"""

from collections.abc import Mapping

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from care_sim.base.errors import percent
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL
from care_sim.reports.figures.styles import Style, styles
from care_sim.reports.formatting import MARKS, marked, tag_notes
from care_sim.reports.protocol.rows import SettingPlays
from care_sim.study.run_config import FULL, REFERENCE

Point = tuple[float, float]
"""Overall and first-sighting recall in %."""


def pareto_figure(plays: SettingPlays) -> Figure:
    """Markers of all policies, and in grey the Pareto frontier of those that a car can have.

    What lies below and left of the staircase is beaten in one recall and not better in the other.
    Open markers show what lies under them; that of CARE is filled.
    """
    figure = Figure(figsize=(8.4, 3.6), layout="constrained")
    panels = figure.subplots(1, len(plays.budgets), squeeze=False)[0]
    drawn = styles(plays.tags.items())
    for axes, budget in zip(panels, plays.budgets, strict=True):
        points = {
            policy: point for policy in plays.policies if (point := recalls(plays, policy, budget))
        }
        _draw(axes, points, drawn, plays)
        axes.set_title(f"budget {percent(budget)}", loc="left", fontsize=10)
    panels[0].set_ylabel("first-sighting recall (%)")
    _name(figure, panels[0], plays)
    return figure


def frontier(points: Mapping[str, Point]) -> list[str]:
    """The policies that no other equals in both recalls and beats in one, from least to most
    overall recall.
    """
    best = [
        name
        for name, point in points.items()
        if not any(_beats(other, point) for other in points.values())
    ]
    return sorted(best, key=lambda name: points[name])


def _beats(other: Point, point: Point) -> bool:
    return other != point and all(theirs >= ours for theirs, ours in zip(other, point, strict=True))


def recalls(plays: SettingPlays, policy: str, budget: float) -> Point | None:
    """Where a policy stands at a budget; None where a recall is not known."""
    overall, first = (
        plays.level(ratio, policy, budget).by_event for ratio in (OVERALL, FIRST_SIGHTING)
    )
    return None if overall is None or first is None else (overall, first)


def _draw(
    axes: Axes, points: Mapping[str, Point], drawn: Mapping[str, Style], plays: SettingPlays
) -> None:
    for policy, (overall, first) in points.items():
        look = drawn[policy]
        (marker,) = axes.plot(
            overall, first, look.marker, color=look.colour, label=marked(policy, plays.tags[policy])
        )
        if policy == REFERENCE:
            marker.set(markersize=5, zorder=5)
        else:
            marker.set(markersize=9, markerfacecolor="none", markeredgewidth=1.5, zorder=4)
    axes.margins(0.1)
    _staircase(
        axes, {policy: point for policy, point in points.items() if not _marks(plays.tags[policy])}
    )
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="0.94")
    axes.set_axisbelow(True)


def _marks(tags: tuple[str, ...]) -> bool:
    return any(tag in MARKS for tag in tags)


def _staircase(axes: Axes, points: Mapping[str, Point]) -> None:
    """The frontier, from the left edge of the axes to the lower one."""
    corners = [points[policy] for policy in frontier(points)]
    if not corners:
        return
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    overall, first = zip((left, corners[0][1]), *corners, (corners[-1][0], low), strict=True)
    axes.step(overall, first, where="pre", color="0.6", linewidth=1.2, zorder=2)
    axes.set(xlim=(left, right), ylim=(low, high))


def _name(figure: Figure, axes: Axes, plays: SettingPlays) -> None:
    """The title, the markers by policy, what the full scan reaches, and what the grey line is."""
    figure.suptitle(
        f"{plays.setting.label}: {len(plays.scenes)} scenes", x=0.01, ha="left", fontsize=10
    )
    ceiling = recalls(plays, FULL, 1.0) if plays.full else None
    reached = (
        f"; full scan: {ceiling[1]:.1f}% of first sightings, {ceiling[0]:.1f}% overall"
        if ceiling
        else ""
    )
    line = f"grey line: Pareto frontier of the policies that a car can have{reached}"
    figure.supxlabel(
        "\n".join(["overall recall (%)", line, *tag_notes(plays.tags.values())]), fontsize=9
    )
    figure.legend(
        *axes.get_legend_handles_labels(), loc="outside right upper", frameon=False, fontsize=9
    )
