"""The figure of learning curves: what is reached on validation seeds against the steps trained."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from care_sim.policies import tags_of
from care_sim.study.styles import FULL, styles
from care_sim.training.curves import Run

LEARNED = "#CC3311"
"""From the palette of Tol (2021); the learner is none of the rules."""
AXIS = {"distance_m": "first detection (m; 0 if never)", "return": "return"}
SCORE = {"distance_m": "distance_m", "return": "mean_return"}


def curves_figure(groups: Sequence[Sequence[Run]]) -> Figure:
    """A panel a task: a line a training seed, their mean where there are several, rules as lines across."""
    figure = Figure(figsize=(1.2 + 4.6 * len(groups), 3.9), layout="constrained")
    panels = figure.subplots(1, len(groups), squeeze=False)[0]
    for axes, runs in zip(panels, groups, strict=True):
        _draw(axes, runs)
        axes.set_ylabel(AXIS[runs[0].measure])
    return figure


def _draw(axes: Axes, runs: Sequence[Run]) -> None:
    config, measure = runs[0].config, runs[0].measure
    for run in runs:
        axes.plot(run.steps, run.values, color=LEARNED, linewidth=0.9, alpha=0.5 if len(runs) > 1 else 1.0)
    _mean(axes, runs)
    names = [name for name in runs[0].rules if name != "full"]
    drawn = styles((name, tags_of(name)) for name in names) | {"full": FULL}
    for name, score in runs[0].rules.items():
        axes.axhline(score[SCORE[measure]], color=drawn[name].colour, linestyle="--", linewidth=1.1, zorder=1)
    heights = {name: score[SCORE[measure]] for name, score in runs[0].rules.items()}
    heights[config["algorithm"]] = float(np.mean([run.values[-1] for run in runs]))
    _name_lines(axes, heights, {name: style.colour for name, style in drawn.items()} | {config["algorithm"]: LEARNED})
    seeds = f"{len(runs)} training seed{'s' if len(runs) > 1 else ''}"
    axes.set_title(f"{config['env']} at {config['budget'][0]:.0%}, {seeds}", loc="left", fontsize=10)
    axes.set_xlabel(f"environment steps\n{config['episodes']} validation episodes a point")
    axes.set_xlim(0, max(run.steps[-1] for run in runs))
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="y", color="0.92")


def _mean(axes: Axes, runs: Sequence[Run]) -> None:
    shared = min(runs, key=lambda run: len(run.steps)).steps
    if len(runs) > 1 and all(list(run.steps[: len(shared)]) == list(shared) for run in runs):
        values = np.mean([run.values[: len(shared)] for run in runs], axis=0)
        axes.plot(shared, values, color=LEARNED, linewidth=2.2)


def _name_lines(axes: Axes, heights: dict[str, float], colours: dict[str, str]) -> None:
    """Names right of the axes, moved apart where lines lie close."""
    low, high = axes.get_ylim()
    least, last = (high - low) * 0.055, -np.inf
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
