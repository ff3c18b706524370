"""Figure of B90: every count over the budget, with the line of what is enough."""

from collections import Counter
from collections.abc import Sequence

from matplotlib.figure import Figure

from care_sim.evaluation.counts import NEEDLESS
from care_sim.evaluation.smallest_budget import BUDGETS, ENOUGH, MORE_STOPS, names_of, shares
from care_sim.reports.budgets import sorted_by_budget
from care_sim.reports.figures.styles import INK, colours, default_style
from care_sim.reports.formatting import marked
from care_sim.study.benchmark.budgets import BudgetResult

BUDGETS_FIGURE = "b90"
_LINES = ("-", "--", ":", "-.")
"""Of the entries of one policy, which share its colour."""


@default_style()
def budgets_figure(results: Sequence[BudgetResult]) -> Figure:
    """Draw a panel per count and a curve per result: the share of a full scan's count over the
    share of the cells that fire.
    """
    ordered = sorted_by_budget(results)
    names = names_of(ordered[0].counts)
    figure = Figure(figsize=(2.4 * len(names) + 2.4, 3.4), layout="constrained")
    panels = figure.subplots(1, len(names), sharex=True, squeeze=False)[0]
    hues = colours(dict.fromkeys(result.entry.policy for result in ordered))
    percents = [100 * budget for budget in BUDGETS]
    for place, (axes, name) in enumerate(zip(panels, names, strict=True)):
        is_stop = name == NEEDLESS
        axes.axhline(-100 * MORE_STOPS if is_stop else 100 * ENOUGH, color=INK, lw=1, ls=":")
        drawn: Counter[str] = Counter()
        for result in ordered:
            policy = result.entry.policy
            line = _LINES[drawn[policy] % len(_LINES)]
            drawn[policy] += 1
            heights = 100 * shares(result.counts)[:, place]
            label = marked(result.entry.name, result.tags) if place == 0 else None
            look = {"marker": "o", "ms": 3, "lw": 1.3, "color": hues[policy], "label": label}
            axes.plot(percents, heights, line, **look)
        axes.set_xscale("log")
        axes.set_xticks(percents, [f"{percent:g}" for percent in percents])
        axes.minorticks_off()
        axes.set_title(name)
        if not is_stop:
            axes.set_ylim(0, 105)
    panels[0].set_ylabel("% of a full scan's")
    figure.supxlabel("% of the cells", fontsize=9)
    figure.legend(loc="outside right upper")
    return figure
