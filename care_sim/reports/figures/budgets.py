"""Figure of B90: every count over the budget, with the line of what is enough."""

from collections import Counter
from collections.abc import Container, Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from care_sim.evaluation.counts import NEEDLESS
from care_sim.evaluation.smallest_budget import BUDGETS, ENOUGH, MORE_STOPS, names_of, shares
from care_sim.reports.budgets import sorted_by_budget
from care_sim.reports.figures.curves import MOST_NAMED
from care_sim.reports.figures.styles import CALM, INK, colours, default_style, name_ends
from care_sim.reports.formatting import marked
from care_sim.study.benchmark.budgets import BudgetResult
from care_sim.study.benchmark.suite import Entry

BUDGETS_FIGURE = "b90"
_LINES = ("-", "--", ":", "-.")
"""Line styles of the entries of one policy, which share its colour."""

_Looks = Mapping[Entry, Mapping[str, Any]]


@default_style()
def budgets_figure(results: Sequence[BudgetResult]) -> Figure:
    """Draw a row of panels per part, a panel per count and a curve per result. Axes: share of a
    full scan's count over share of fired cells. The first seven of `results` have a colour, and a
    name right of each row; all others are thin and grey.
    """
    ordered = sorted_by_budget(results)
    looks = _looks(ordered, [one.entry for one in results[:MOST_NAMED]])
    parts = ordered[0].parts
    widest = max(len(counts.names) for counts in ordered[0].counts)
    figure = Figure(figsize=(2.4 * widest + 1.6, 0.8 + 2.6 * len(parts)), layout="constrained")
    panels = figure.subplots(len(parts), widest, sharex=True, squeeze=False)
    ends = {}
    for part, row in zip(parts, panels, strict=True):
        told = f"{part}, " if len(parts) > 1 else ""
        row[0].set_ylabel(f"{told}% of a full scan's")
        own = [one.of_part(part) for one in ordered]
        ends[_draw(own, row, looks)] = {
            marked(one.entry.name, one.tags): (100 * float(shares(one.counts)[-1, -1]), hue)
            for one in own
            if (hue := looks[one.entry]["color"]) != CALM
        }
    figure.supxlabel("% of the cells", fontsize=9)
    name_ends(figure, ends)
    return figure


def _looks(ordered: Sequence[BudgetResult], named: Container[Entry]) -> _Looks:
    hues = colours(dict.fromkeys(one.entry.policy for one in ordered if one.entry in named))
    looks: dict[Entry, dict[str, Any]] = {}
    drawn: Counter[str] = Counter()
    for entry in (one.entry for one in ordered):
        if entry not in named:
            looks[entry] = {"color": CALM, "lw": 0.7, "alpha": 0.6}
            continue
        line = _LINES[drawn[entry.policy] % len(_LINES)]
        drawn[entry.policy] += 1
        looks[entry] = {"color": hues[entry.policy], "ls": line, "lw": 1.3, "marker": "o", "ms": 3}
    return looks


def _draw(ordered: Sequence[BudgetResult], row: Sequence[Axes], looks: _Looks) -> Axes:
    """Draw the panels of one part, and return the last one; what is left of the row disappears."""
    names = names_of(ordered[0].counts)
    for axes in row[len(names) :]:
        axes.remove()
    percents = [100 * budget for budget in BUDGETS]
    for place, (axes, name) in enumerate(zip(row, names, strict=False)):
        is_stop = name == NEEDLESS
        axes.axhline(-100 * MORE_STOPS if is_stop else 100 * ENOUGH, color=INK, lw=1, ls=":")
        for one in ordered:
            axes.plot(percents, 100 * shares(one.counts)[:, place], **looks[one.entry])
        axes.set_xscale("log")
        axes.set_xticks(percents, [f"{percent:g}" for percent in percents])
        axes.minorticks_off()
        axes.set_title(name)
        if not is_stop:
            axes.set_ylim(0, 105)
    return row[len(names) - 1]
