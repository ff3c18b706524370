"""Figures of the leaderboard: every score with its interval, with the parts that make it or as a
bar chart.
"""

from collections.abc import Sequence

from matplotlib.figure import Figure
from matplotlib.patches import Patch

from care_sim.base.errors import percent
from care_sim.reports.figures.files import default_style
from care_sim.reports.figures.styles import bare_axes
from care_sim.reports.leaderboard import names_in, ranked
from care_sim.study.benchmark.result import BenchmarkResult
from care_sim.study.benchmark.tasks import BENCHMARK_BUDGET

LEADERBOARD_FIGURE = "leaderboard"
_PARTS = {"drives": ("#D55E00", "v"), "tests": ("#E69F00", "s"), "streets": ("#0072B2", "^")}
"""From the palette of Okabe and Ito (2008), safe for the colour-blind."""
_LINE_INCHES = 0.28
_BAR_INCHES = 0.42
_CAMERA, _NO_CAMERA = "#0072B2", "#E69F00"
_APART = 0.18
"""By how much of a line the marks of a result are moved apart, so that equal ones are seen."""


@default_style()
def leaderboard_figure(results: Sequence[BenchmarkResult]) -> Figure:
    """A line for every result, the highest score on top."""
    # Lines are counted from below.
    upwards = ranked(results)[::-1]
    figure = Figure(figsize=(8.0, 1.4 + _LINE_INCHES * len(upwards)), layout="constrained")
    axes = figure.subplots()
    lines = range(len(upwards))
    # The score stands lowest, the parts above it.
    lowest = -_APART * len(results[0].parts) / 2
    for number, part in enumerate(results[0].parts, 1):
        colour, marker = _PARTS[part]
        shares = [result.part_score(part) for result in upwards]
        heights = [line + lowest + _APART * number for line in lines]
        axes.scatter(shares, heights, s=22, color=colour, marker=marker, label=part, zorder=3)
    scores = [result.score() for result in upwards]
    means = [score.mean for score in scores]
    ends = [
        [max(score.mean - score.low, 0.0) for score in scores],
        [max(score.high - score.mean, 0.0) for score in scores],
    ]
    axes.errorbar(
        means,
        [line + lowest for line in lines],
        xerr=ends,
        fmt="o",
        color="black",
        capsize=3,
        label="score, 95% interval",
    )
    axes.set_yticks(lines, names_in(upwards))
    axes.set_xlim(-2, 102)
    axes.set_xlabel("% of what a full scan reaches")
    bare_axes(axes, "0.93", "both")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper left", ncols=4)
    return figure


@default_style()
def score_chart(results: Sequence[BenchmarkResult]) -> Figure:
    """Draw the score of every result as a bar with its interval, the highest score on top.

    Policies without a camera have a colour of their own.
    """
    upwards = ranked(results)[::-1]
    figure = Figure(figsize=(8.0, 1.2 + _BAR_INCHES * len(upwards)), layout="constrained")
    axes = figure.subplots()
    for line, result in enumerate(upwards):
        mean, low, high = result.score()
        colour = _CAMERA if result.uses_camera else _NO_CAMERA
        ends = [[max(mean - low, 0.0)], [max(high - mean, 0.0)]]
        axes.barh(line, mean, 0.7, color=colour, xerr=ends, capsize=4)
        axes.text(high + 1, line, f"{mean:.0f}", fontsize=12, va="center")
    axes.set_yticks(range(len(upwards)), names_in(upwards), fontsize=12)
    # Room for the number of a full scan.
    axes.set_xlim(0, 108)
    budget = percent(BENCHMARK_BUDGET)
    axes.set_xlabel(
        f"score with {budget} of the rays: % of a full scan's result, 95% interval", fontsize=12
    )
    bare_axes(axes, "0.93", "both")
    kinds = [
        Patch(color=_CAMERA, label="uses a camera"),
        Patch(color=_NO_CAMERA, label="no camera"),
    ]
    figure.legend(handles=kinds, loc="outside upper right", ncols=2, fontsize=12, frameon=False)
    return figure
