"""Figure of the leaderboard: B90 of every entry with its interval, and of each part or count."""

from collections.abc import Iterable, Sequence
from math import isinf
from typing import Any

from matplotlib.figure import Figure

from care_sim.evaluation.smallest_budget import BUDGETS, names_of, reaching
from care_sim.reports.budgets import names_in, sorted_by_budget
from care_sim.reports.figures.styles import INK, colours, default_style
from care_sim.study.benchmark.budgets import BudgetResult

LEADERBOARD_FIGURE = "leaderboard"
_NEVER = 100 * BUDGETS[-1] * 1.6
"""Where "never" is drawn, in % of the cells."""
_MARKERS = "v^sdP*"
_SIZES = 60, 30, 12
"""Areas of the markers, in square points: markers of one budget are seen in each other."""
_LINE_INCHES = 0.26


@default_style()
def leaderboard_figure(results: Sequence[BudgetResult]) -> Figure:
    """Draw a line per result, the first of `sorted_by_budget` on top: B90 with its interval, and
    the budget that each part alone needs, or each count of a single part.
    """
    # Lines are counted from below.
    upwards = sorted_by_budget(results)[::-1]
    lines = range(len(upwards))
    figure = Figure(figsize=(8.0, 1.5 + _LINE_INCHES * len(upwards)), layout="constrained")
    axes = figure.subplots()
    parts = upwards[0].parts
    names = parts if len(parts) > 1 else names_of(upwards[0].counts)
    needs = [[_place(budget) for budget in _needs(each)] for each in upwards]
    hues = colours(dict.fromkeys(names))
    for n, name in enumerate(names):
        look: dict[str, Any] = {
            "color": hues[name],
            "marker": _MARKERS[n % len(_MARKERS)],
            "label": name,
        }
        size = _SIZES[min(n, len(_SIZES) - 1)]
        axes.scatter([own[n] for own in needs], lines, s=size, zorder=3, **look)
    ends = [[_place(value) for value in each.score] for each in upwards]
    budgets = [budget for budget, _, _ in ends]
    spans = [[b - low for b, low, _ in ends], [high - b for b, _, high in ends]]
    label = "B90, 95% interval"
    axes.errorbar(
        budgets, lines, xerr=spans, fmt="o", color=INK, capsize=3, mfc="none", label=label
    )
    axes.set_xscale("log")
    ticks = [100 * budget for budget in BUDGETS]
    axes.set_xticks([*ticks, _NEVER], [*(f"{tick:g}" for tick in ticks), "never"])
    axes.minorticks_off()
    axes.set_yticks(lines, names_in(upwards))
    axes.set_ylim(-0.6, len(upwards) - 0.4)
    axes.set_xlabel("% of the cells for 90% of what a full scan has")
    axes.grid(axis="x")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper left", ncols=5)
    return figure


def _needs(result: BudgetResult) -> Iterable[float]:
    if len(result.parts) == 1:
        return reaching(result.counts)
    return [result.of_part(part).score.budget for part in result.parts]


def _place(budget: float) -> float:
    return _NEVER if isinf(budget) else 100 * budget
