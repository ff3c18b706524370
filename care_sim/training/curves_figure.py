"""The figure of learning curves: results on validation seeds against training steps, and
performance profiles over episodes.
"""

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from care_sim.base.errors import percent
from care_sim.core.arrays import Floats
from care_sim.reports.figures.curves import MOST_NAMED
from care_sim.reports.figures.styles import CALM, colours, default_style, name_ends
from care_sim.training.curves import (
    TrainingRun,
    interquartile_mean,
    performance_profile,
    recipe_name,
    scores_at,
    shared_steps,
)
from care_sim.training.folder import LEARNER

_FIRST = ("full", "history", "all-camera", "care")
"""Rules that are named before others: the paper's."""
_LEVELS = 60
"""Points of a profile."""
_LINE = 50
"""Characters of a title that fit over a panel."""


@default_style()
def curves_figure(groups: Sequence[Sequence[TrainingRun]]) -> Figure:
    """Draw a panel per recipe. It has a line per training seed, their interquartile mean with its
    interval if there are several, and rules as horizontal lines. Below is the performance profile
    of the last evaluation that all runs share, in the same colours. The learner and six rules have
    a name, other rules are grey.
    """
    figure = Figure(figsize=(1.2 + 4.6 * len(groups), 7.8), layout="constrained")
    panels = figure.subplots(2, len(groups), squeeze=False)
    # Panels of one unit have one scale, so that heights compare.
    scales: dict[str, Axes] = {}
    for axes, below, runs in zip(*panels, groups, strict=True):
        unit = runs[0].unit
        if unit in scales:
            axes.sharey(scales[unit])
        scales.setdefault(unit, axes)
        _draw(axes, runs)
        axes.set_ylabel(unit)
        _draw_profiles(below, runs)
    name_ends(figure, {axes: _ends(runs) for axes, runs in zip(panels[0], groups, strict=True)})
    return figure


def _draw(axes: Axes, runs: Sequence[TrainingRun]) -> None:
    config = runs[0].config
    learner = config["algorithm"]
    hues = _hues(runs)
    for name, height in _heights(runs).items():
        axes.axhline(height, **_rule_look(hues[name]), zorder=1)
    for run in runs:
        axes.plot(
            run.steps,
            [_middle(run.scores(steps=steps)) for steps in run.steps],
            color=hues[learner],
            linewidth=0.9,
            alpha=0.5 if len(runs) > 1 else 1.0,
        )
    _all_seeds(axes, runs, hues[learner])
    # A run is evaluated before its first step too, so the last step may be 0.
    axes.set_xlim(0, max(1, *(run.steps[-1] for run in runs)))
    # Metres are never below 0; a score is, if a learner is worse than `random`.
    if runs[0].closed_loop and len(runs[0].tasks) == 1:
        axes.set_ylim(bottom=0)
    _describe(axes, config, len(runs))


def _describe(axes: Axes, config: Mapping[str, Any], seeds: int) -> None:
    axes.set_title(
        fill(f"{recipe_name(config)}, {seeds} training seed{'s' * (seeds > 1)}", _LINE),
        loc="left",
        size=10,
    )
    trained = ", ".join(percent(budget) for budget in config["budget"])
    thick = "their interquartile mean, 95% interval"
    drawn = f"thin: each training seed\nthick: {thick}\n" if seeds > 1 else ""
    played = "all budgets" if config.get("drawn") else percent(config["budget"][0])
    axes.set_xlabel(
        f"environment steps, in thousands\n{drawn}trained at budget {trained}\n"
        f"a point is the mean of {config['episodes']} validation episodes at {played}"
    )
    axes.xaxis.set_major_formatter(lambda steps, _: f"{steps / 1000:g}")


def _all_seeds(axes: Axes, runs: Sequence[TrainingRun], colour: str) -> None:
    # Runs may be of different lengths, as far as they were evaluated at the same steps.
    shared = shared_steps(runs)
    if len(runs) > 1 and shared:
        reached = [interquartile_mean(scores_at(runs, steps)) for steps in shared]
        axes.plot(shared, [one.value for one in reached], color=colour, linewidth=2.2)
        low, high = ([getattr(one, end) for one in reached] for end in ("low", "high"))
        axes.fill_between(shared, low, high, color=colour, alpha=0.15, linewidth=0)


def _draw_profiles(axes: Axes, runs: Sequence[TrainingRun]) -> None:
    """Draw the share of episodes above a score, for the learner's runs and for the rules."""
    learner, shared = runs[0].config["algorithm"], shared_steps(runs)
    played = {rule: runs[0].each(rule)[None] for rule in runs[0].rules}
    own = [run.each(LEARNER, shared[-1]) for run in runs] if shared else []
    same = len({len(one) for one in own}) == 1
    played |= {learner: np.array(own)} if same else {}
    hues = _hues(runs)
    every = np.concatenate([scores.ravel() for scores in played.values()])
    levels = np.linspace(every.min(), every.max(), _LEVELS)
    for name, scores in played.items():
        profile = performance_profile(scores, levels)
        style = {"linewidth": 2.2} if name == learner else _rule_look(hues[name])
        axes.plot(levels, [one.value for one in profile], **{"color": hues[name]} | style)
        if len(scores) > 1:
            low, high = ([getattr(one, end) for one in profile] for end in ("low", "high"))
            axes.fill_between(levels, low, high, color=hues[name], alpha=0.15, linewidth=0)
    axes.set_ylabel("share of episodes above")
    unit = "return" if len(runs[0].tasks) > 1 else runs[0].unit
    axes.set_xlabel(f"{unit}, after {shared[-1]:,} steps" if same else unit)


def _middle(scores: Floats) -> float:
    """Return the middle of the scores of the tasks (n,) of one run, or of a rule."""
    return interquartile_mean(scores[None]).value


def _heights(runs: Sequence[TrainingRun]) -> dict[str, float]:
    """Return the heights of the rules' lines."""
    return {rule: _middle(runs[0].scores(rule)) for rule in runs[0].rules}


def _rule_look(hue: str) -> dict[str, Any]:
    width, alpha = (0.7, 0.6) if hue == CALM else (1.1, 1.0)
    return {"color": hue, "linestyle": "--", "linewidth": width, "alpha": alpha}


def _hues(runs: Sequence[TrainingRun]) -> dict[str, str]:
    """Return the colour of the learner and of every rule: grey for all but seven. The paper's rules
    come first, then the best others.
    """
    learner, heights = runs[0].config["algorithm"], _heights(runs)
    first = [name for name in _FIRST if name in heights]
    ranked = dict.fromkeys([learner, *first, *sorted(heights, key=lambda name: -heights[name])])
    named = colours([*ranked][:MOST_NAMED])
    return {name: named.get(name, CALM) for name in ranked}


def _ends(runs: Sequence[TrainingRun]) -> dict[str, tuple[float, str]]:
    """Return the right ends of the learner's curve and of named lines, with their colours."""
    last = float(np.mean([_middle(run.scores(steps=run.steps[-1])) for run in runs]))
    heights = _heights(runs) | {runs[0].config["algorithm"]: last}
    return {name: (heights[name], hue) for name, hue in _hues(runs).items() if hue != CALM}
