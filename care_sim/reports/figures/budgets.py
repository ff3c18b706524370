"""Figure of B90: every count over the budget, with the line of what is enough."""

from collections import Counter
from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from care_sim.evaluation.counts import NEEDLESS
from care_sim.evaluation.smallest_budget import BUDGETS, ENOUGH, MORE_STOPS, names_of, shares
from care_sim.reports.budgets import sorted_by_budget
from care_sim.reports.figures.styles import INK, colours, default_style
from care_sim.reports.formatting import marked
from care_sim.study.benchmark.budgets import BudgetResult

BUDGETS_FIGURE = "b90"
_LINES = ("-", "--", ":", "-.")
"""Line styles of the entries of one policy, which share its colour."""


@default_style()
def budgets_figure(results: Sequence[BudgetResult]) -> Figure:
    """Draw a row of panels per part, a panel per count and a curve per result. Axes: share of a
    full scan's count over share of fired cells.
    """
    ordered = sorted_by_budget(results)
    parts = ordered[0].parts
    widest = max(len(counts.names) for counts in ordered[0].counts)
    figure = Figure(figsize=(2.4 * widest + 2.4, 0.8 + 2.6 * len(parts)), layout="constrained")
    panels = figure.subplots(len(parts), widest, sharex=True, squeeze=False)
    for part, row in zip(parts, panels, strict=True):
        told = f"{part}, " if len(parts) > 1 else ""
        row[0].set_ylabel(f"{told}% of a full scan's")
        _draw([one.of_part(part) for one in ordered], row)
    for curve, one in zip(panels[0, 0].get_lines()[1:], ordered, strict=True):
        curve.set_label(marked(one.entry.name, one.tags))
    figure.supxlabel("% of the cells", fontsize=9)
    figure.legend(loc="outside right upper")
    return figure


def _draw(ordered: Sequence[BudgetResult], row: Sequence[Axes]) -> None:
    """Draw the panels of one part; what is left of the row disappears."""
    names = names_of(ordered[0].counts)
    for axes in row[len(names) :]:
        axes.remove()
    hues = colours(dict.fromkeys(result.entry.policy for result in ordered))
    percents = [100 * budget for budget in BUDGETS]
    for place, (axes, name) in enumerate(zip(row, names, strict=False)):
        is_stop = name == NEEDLESS
        axes.axhline(-100 * MORE_STOPS if is_stop else 100 * ENOUGH, color=INK, lw=1, ls=":")
        drawn: Counter[str] = Counter()
        for result in ordered:
            policy = result.entry.policy
            line = _LINES[drawn[policy] % len(_LINES)]
            drawn[policy] += 1
            heights = 100 * shares(result.counts)[:, place]
            axes.plot(percents, heights, line, marker="o", ms=3, lw=1.3, color=hues[policy])
        axes.set_xscale("log")
        axes.set_xticks(percents, [f"{percent:g}" for percent in percents])
        axes.minorticks_off()
        axes.set_title(name)
        if not is_stop:
            axes.set_ylim(0, 105)
