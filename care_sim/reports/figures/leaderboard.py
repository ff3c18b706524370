"""Figures of the leaderboard: every score with its interval, with the parts that make it or as a
bar chart.
"""

from collections.abc import Sequence
from typing import Any

from matplotlib.figure import Figure
from matplotlib.patches import Patch

from care_sim.base.errors import percent
from care_sim.reports.figures.styles import BLUE, INK, ORANGE, YELLOW, default_style
from care_sim.reports.leaderboard import names_in, ranked
from care_sim.study.benchmark.result import BenchmarkResult
from care_sim.study.benchmark.suite import BENCHMARK_BUDGET

LEADERBOARD_FIGURE = "leaderboard"
_PARTS = {"drives": (ORANGE, "v"), "tests": (YELLOW, "s"), "streets": (BLUE, "^")}
_CAMERA, _NO_CAMERA = BLUE, YELLOW
_LINE_INCHES, _BAR_INCHES = 0.26, 0.36


@default_style()
def leaderboard_figure(results: Sequence[BenchmarkResult]) -> Figure:
    """A line for every result, the highest score on top: its score, and the parts that make it."""
    # Lines are counted from below.
    upwards = ranked(results)[::-1]
    lines = range(len(upwards))
    figure = Figure(figsize=(8.0, 1.4 + _LINE_INCHES * len(upwards)), layout="constrained")
    axes = figure.subplots()
    for part in results[0].parts:
        colour, marker = _PARTS[part]
        shares = [result.part_score(part) for result in upwards]
        axes.scatter(shares, lines, s=22, color=colour, marker=marker, label=part, zorder=3)
    scores = [result.score() for result in upwards]
    means = [score.mean for score in scores]
    ends = [
        [max(score.mean - score.low, 0.0) for score in scores],
        [max(score.high - score.mean, 0.0) for score in scores],
    ]
    look: dict[str, Any] = {"color": INK, "capsize": 3, "label": "score, 95% interval"}
    axes.errorbar(means, lines, xerr=ends, fmt="o", **look)
    axes.set_yticks(lines, names_in(upwards))
    axes.set_ylim(-0.6, len(upwards) - 0.4)
    axes.set_xlim(-2, 102)
    axes.set_xlabel("% of what a full scan reaches")
    axes.grid(axis="x")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper left", ncols=4)
    return figure


@default_style()
def score_chart(results: Sequence[BenchmarkResult]) -> Figure:
    """Draw the score of every result as a bar with its interval, the highest score on top.

    Policies without a camera have a colour of their own.
    """
    # Lines are counted from below.
    upwards = ranked(results)[::-1]
    figure = Figure(figsize=(8.0, 1.2 + _BAR_INCHES * len(upwards)), layout="constrained")
    axes = figure.subplots()
    for line, result in enumerate(upwards):
        mean, low, high = result.score()
        colour = _CAMERA if result.uses_camera else _NO_CAMERA
        ends = [[max(mean - low, 0.0)], [max(high - mean, 0.0)]]
        axes.barh(line, mean, 0.7, color=colour, xerr=ends, ecolor=INK, capsize=4)
        axes.text(high + 1, line, f"{mean:.0f}", va="center")
    axes.set_yticks(range(len(upwards)), names_in(upwards), fontsize=10)
    # Room for the number of a full scan.
    axes.set_xlim(0, 108)
    budget = percent(BENCHMARK_BUDGET)
    axes.set_xlabel(f"score with {budget} of the rays: % of a full scan's result, 95% interval")
    axes.grid(False)
    axes.grid(axis="x")
    kinds = [
        Patch(color=_CAMERA, label="uses a camera"),
        Patch(color=_NO_CAMERA, label="no camera"),
    ]
    figure.legend(handles=kinds, loc="outside upper right", ncols=2)
    return figure
