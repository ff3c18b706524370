"""The figure of learning curves: what is reached on validation seeds against the steps trained."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from care_sim.base.errors import percent
from care_sim.policies import tags_of
from care_sim.reports.figures.styles import FULL_STYLE, styles
from care_sim.training.curves import TrainingRun


def curves_figure(groups: Sequence[Sequence[TrainingRun]]) -> Figure:
    """A panel per recipe.

    It has a line per training seed, their mean where there are several, and rules as lines across.
    """
    figure = Figure(figsize=(1.2 + 4.6 * len(groups), 3.9), layout="constrained")
    panels = figure.subplots(1, len(groups), squeeze=False)[0]
    for axes, runs in zip(panels, groups, strict=True):
        _draw(axes, runs)
        axes.set_ylabel("first detection (m; 0 if never)" if runs[0].closed_loop else "return")
    return figure


def _draw(axes: Axes, runs: Sequence[TrainingRun]) -> None:
    config = runs[0].config
    marks = runs[0].marks
    learner = config["algorithm"]
    drawn = styles((name, tags_of(name)) for name in (*marks, learner)) | {"full": FULL_STYLE}
    colours = {name: style.colour for name, style in drawn.items()}
    for name, height in marks.items():
        axes.axhline(height, color=colours[name], linestyle="--", linewidth=1.1, zorder=1)
    for run in runs:
        axes.plot(
            run.steps,
            run.values,
            color=colours[learner],
            linewidth=0.9,
            alpha=0.5 if len(runs) > 1 else 1.0,
        )
    _mean(axes, runs, colours[learner])
    # A run is evaluated before its first step too, so the last step may be 0.
    axes.set_xlim(0, max(1, *(run.steps[-1] for run in runs)))
    if runs[0].closed_loop:
        axes.set_ylim(bottom=0)
    _name_lines(axes, marks | {learner: float(np.mean([run.values[-1] for run in runs]))}, colours)
    _describe(axes, config, len(runs))


def _describe(axes: Axes, config: Mapping[str, Any], seeds: int) -> None:
    axes.set_title(
        f"{config['algorithm']}, {config['env']}, {seeds} training seed{'s' * (seeds > 1)}",
        loc="left",
        size=10,
    )
    trained = ", ".join(percent(budget) for budget in config["budget"])
    drawn = "thin: each training seed, thick: their mean\n" if seeds > 1 else ""
    axes.set_xlabel(
        f"environment steps, in thousands\n{drawn}trained at budget {trained}\n"
        f"a point is the mean of {config['episodes']} validation episodes at "
        f"{percent(config['budget'][0])}"
    )
    axes.xaxis.set_major_formatter(lambda steps, _: f"{steps / 1000:g}")
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="y", color="0.92")


def _mean(axes: Axes, runs: Sequence[TrainingRun], colour: str) -> None:
    # Runs may be of different lengths, as far as they were evaluated at the same steps.
    shared = min((run.steps for run in runs), key=len)
    if len(runs) > 1 and all(run.steps[: len(shared)] == shared for run in runs):
        values = np.mean([run.values[: len(shared)] for run in runs], axis=0)
        axes.plot(shared, values, color=colour, linewidth=2.2)


def _name_lines(axes: Axes, heights: dict[str, float], colours: dict[str, str]) -> None:
    """Names right of the axes, moved apart where lines lie close."""
    low, high = axes.get_ylim()
    # A line of text is about 5.5% of the axis high. From the lowest up, each name stands at least
    # that far above the one before.
    least = (high - low) * 0.055
    last = -np.inf
    for name, height in sorted(heights.items(), key=lambda pair: pair[1]):
        last = max(height, last + least)
        axes.annotate(
            name,
            (1.0, last),
            (6, 0),
            xycoords=axes.get_yaxis_transform(),
            textcoords="offset points",
            va="center",
            size=9,
            color=colours[name],
            annotation_clip=False,
        )
