"""The figure of what every policy has over the best control, in points of recall by budget."""

from collections.abc import Sequence
from textwrap import wrap

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from care_sim.base.errors import percent
from care_sim.reports.controls import BEST_CONTROL
from care_sim.reports.figures.styles import OPEN_LOOP_DODGE, bare_axes, name_outside, styles
from care_sim.reports.formatting import marked, tag_notes
from care_sim.reports.protocol.controls import RULE, OverControl, named_controls
from care_sim.reports.protocol.rows import SettingPlays
from care_sim.study.run_config import REFERENCE

_NOTE_WIDTH = 100
"""Letters of a note in one line below the panels."""


def control_figure(plays: SettingPlays, measures: Sequence[OverControl]) -> Figure:
    """A panel a measure (of which there must be one): every other policy less the best control, in
    points, with bars over the intervals.
    """
    figure = Figure(figsize=(8.4, 4.0), layout="constrained")
    panels = figure.subplots(1, len(measures), squeeze=False)[0]
    for axes, measure in zip(panels, measures, strict=True):
        axes.axhline(0.0, color="0.35", linewidth=1.2, linestyle="--", label=BEST_CONTROL)
        _draw_differences(axes, plays, measure)
        axes.set_xscale("log")
        axes.set_xticks(plays.budgets, [percent(budget) for budget in plays.budgets])
        axes.minorticks_off()
        axes.set_title(measure.ratio.name, loc="left", fontsize=10)
        bare_axes(axes, "0.93")
    panels[0].set_ylabel(f"points over the {BEST_CONTROL}")
    figure.suptitle(plays.title, x=0.01, ha="left", fontsize=10)
    notes = [
        "budget (share of cells fired); bars: 95% intervals",
        *wrap(f"{named_controls(plays, measures)} {RULE}", _NOTE_WIDTH),
        *tag_notes(plays.tags[policy] for policy in measures[0].differences),
    ]
    figure.supxlabel("\n".join(notes), fontsize=9)
    name_outside(figure, panels)
    return figure


def _draw_differences(axes: Axes, plays: SettingPlays, measure: OverControl) -> None:
    # The styles of all policies, so that each looks as it does in the other figures.
    drawn = styles(plays.tags.items())
    for number, (policy, differences) in enumerate(measure.differences.items()):
        look = drawn[policy]
        shift = OPEN_LOOP_DODGE.factor(number, len(measure.differences))
        known = {
            budget * shift: difference
            for budget, difference in zip(plays.budgets, differences, strict=True)
            if difference
        }
        means = [difference.mean for difference in known.values()]
        # The policy under test lies above those that it is held against.
        order = 4 if policy == REFERENCE else 3
        (line,) = axes.plot(list(known), means, look.line, color=look.colour, zorder=order)
        line.set(marker=look.marker, markersize=6, label=marked(policy, plays.tags[policy]))
        line.set(linewidth=1.4)
        for place, difference in known.items():
            if difference.interval:
                (bar,) = axes.plot([place] * 2, difference.interval[1:], color=look.colour)
                bar.set(linewidth=1.2, zorder=order)
