"""Figures of the first-sighting protocol: the paper's Figures 2 and 3 for every setting that has
them, and the policies over the best control.
"""

import math
from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from care_sim.base.errors import percent
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL, Ratio
from care_sim.reports.figures.apart import BESIDE_PLACES, move_apart
from care_sim.reports.figures.controls import control_figure
from care_sim.reports.figures.styles import (
    APART,
    FULL_STYLE,
    OPEN_LOOP_DODGE,
    Style,
    bare_axes,
    name_outside,
    styles,
)
from care_sim.reports.formatting import MARKS, marked, tag_notes
from care_sim.reports.protocol.controls import over_controls
from care_sim.reports.protocol.paper import published_level
from care_sim.reports.protocol.rows import SettingPlays, plays_by_setting
from care_sim.study.run_config import FULL, REFERENCE, Row

_PANELS_A_LINE = 4
_KINDS = ("pareto", "levels", "controls")
PROTOCOL_FIGURES = tuple(f"{kind}-{{world}}{rest}" for kind in _KINDS for rest in ("", "-*"))
"""Every figure that a folder may hold of a source, as patterns: behind the source stands what is
not usual in detector and conditions.
"""


def protocol_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Figures 2 and 3 of the paper for each setting, by name, and what policies have over controls
    where any was played; Figure 3 needs two budgets.
    """
    figures = {}
    for plays in plays_by_setting(rows):
        if plays.policies:
            figures[f"pareto-{plays.setting.slug}"] = pareto_figure(plays)
        # A single budget makes no curve.
        if len(plays.budgets) > 1:
            figures[f"levels-{plays.setting.slug}"] = levels_figure(plays)
        if measures := over_controls(plays):
            figures[f"controls-{plays.setting.slug}"] = control_figure(plays, measures)
    return figures


Point = tuple[float, float]
"""Overall and first-sighting recall in %."""


def pareto_figure(plays: SettingPlays) -> Figure:
    """Markers of all policies, and in grey the Pareto frontier of those that a car can have.

    What lies below and left of the staircase is beaten in one recall and not better in the other.
    Markers are open, that of CARE is filled; those that would hide each other are moved apart.
    """
    lines = math.ceil(len(plays.budgets) / _PANELS_A_LINE)
    figure = Figure(figsize=(8.4, 1.2 + 2.4 * lines), layout="constrained")
    grid = figure.subplots(lines, math.ceil(len(plays.budgets) / lines), squeeze=False)
    panels, left_over = grid.flat[: len(plays.budgets)], grid.flat[len(plays.budgets) :]
    for axes in left_over:
        axes.set_axis_off()
    drawn = styles(plays.tags.items())
    markers = []
    for axes, budget in zip(panels, plays.budgets, strict=True):
        points = {
            policy: point for policy in plays.policies if (point := recalls(plays, policy, budget))
        }
        markers.append(_draw_recalls(axes, points, drawn, plays))
        axes.set_title(f"budget {percent(budget)}", loc="left", fontsize=10)
    figure.supylabel("first-sighting recall (%)", fontsize=10)
    _name_markers(figure, [*panels], plays)
    move_apart(figure, [*zip(panels, markers, strict=True)])
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
    # Of two equal points neither beats the other, and both are on the frontier.
    return other != point and all(theirs >= ours for theirs, ours in zip(other, point, strict=True))


def recalls(plays: SettingPlays, policy: str, budget: float) -> Point | None:
    """Where a policy stands at a budget; None where a recall is not known."""
    overall, first = (
        plays.level(ratio, policy, budget).by_event for ratio in (OVERALL, FIRST_SIGHTING)
    )
    return None if overall is None or first is None else (overall, first)


def _draw_recalls(
    axes: Axes, points: Mapping[str, Point], drawn: Mapping[str, Style], plays: SettingPlays
) -> list[Line2D]:
    """Draw them, and return the markers."""
    markers = []
    for policy, (overall, first) in points.items():
        look = drawn[policy]
        (marker,) = axes.plot(
            overall, first, look.marker, color=look.colour, label=marked(policy, plays.tags[policy])
        )
        # CARE is small and filled, so that it is seen within an open marker that is near.
        if policy == REFERENCE:
            marker.set(markersize=5, zorder=5)
        else:
            marker.set(markersize=9, markerfacecolor="none", markeredgewidth=1.5, zorder=4)
        markers.append(marker)
    axes.margins(0.1)
    _staircase(
        axes, {policy: point for policy, point in points.items() if not _marks(plays.tags[policy])}
    )
    bare_axes(axes, "0.94", "both")
    return markers


def _marks(tags: tuple[str, ...]) -> bool:
    return any(tag in MARKS for tag in tags)


def _staircase(axes: Axes, points: Mapping[str, Point]) -> None:
    """The frontier, from the left edge of the axes to the lower one."""
    corners = [points[policy] for policy in frontier(points)]
    if not corners:
        return
    # The limits are read before the line is drawn and set again after it, because the line would
    # widen them.
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    overall, first = zip((left, corners[0][1]), *corners, (corners[-1][0], low), strict=True)
    axes.step(overall, first, where="pre", color="0.6", linewidth=1.2, zorder=2)
    axes.set(xlim=(left, right), ylim=(low, high))


def _name_markers(figure: Figure, panels: Sequence[Axes], plays: SettingPlays) -> None:
    """The title, the markers by policy, what the full scan reaches, and what the grey line is."""
    figure.suptitle(plays.title, x=0.01, ha="left", fontsize=10)
    ceiling = recalls(plays, FULL, 1.0) if plays.full else None
    reached = (
        [f"full scan: {ceiling[1]:.1f}% of first sightings, {ceiling[0]:.1f}% overall"]
        if ceiling
        else []
    )
    line = "grey line: Pareto frontier of the policies that a car can have"
    apart = [BESIDE_PLACES] if len(plays.policies) > 1 else []
    notes = ["overall recall (%)", line, *apart, *reached, *tag_notes(plays.tags.values())]
    figure.supxlabel("\n".join(notes), fontsize=9)
    name_outside(figure, panels)


def levels_figure(plays: SettingPlays) -> Figure:
    """Recalls in % of all policies at all budgets. The full scan is a dashed line. What the paper
    gives of both is hollow and dotted.
    """
    figure = Figure(figsize=(8.4, 4.0), layout="constrained")
    panels = figure.subplots(1, 2)
    for axes, ratio in zip(panels, (FIRST_SIGHTING, OVERALL), strict=True):
        _draw_levels(axes, plays, ratio)
        if plays.setting.as_in_paper:
            # The paper gives levels for its plain setting alone.
            _draw_published(axes, plays, ratio)
        axes.set_xscale("log")
        axes.set_xticks(plays.budgets, [percent(budget) for budget in plays.budgets])
        axes.minorticks_off()
        axes.set_ylabel(f"{ratio.name} (%)")
        bare_axes(axes, "0.93")
    figure.suptitle(plays.title, x=0.01, ha="left", fontsize=10)
    apart = [APART] if len(plays.tags) > 1 else []
    notes = ["budget (share of cells fired)", *apart, *tag_notes(plays.tags.values())]
    figure.supxlabel("\n".join(notes), fontsize=9)
    name_outside(figure, panels)
    return figure


def _draw_levels(axes: Axes, plays: SettingPlays, ratio: Ratio) -> None:
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
        shift = OPEN_LOOP_DODGE.factor(number, len(plays.tags))
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
        line[0].set(marker=look.marker, markersize=6, label=marked(policy, plays.tags[policy]))
        # A thin marker is nothing but its edge.
        if look.marker in Line2D.filled_markers:
            line[0].set(markeredgecolor="white", markeredgewidth=0.5)


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
