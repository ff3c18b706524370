"""The figure of detectors: precision against recall, and whether a score is what it says."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from care_sim.reports.figures.styles import CALM, colours, default_style

DETECTORS_FIGURE = "detectors"
_FEWEST = 20
"""Boxes in a tenth of scores, for its share to be drawn."""


@default_style()
def detectors_figure(detectors: Mapping[str, Mapping[str, Any]]) -> Figure:
    """Draw a line for every detector with scores, a point for every other, each with its name.
    `detectors` are those of `judge.json`.
    """
    figure = Figure(figsize=(9.2, 4.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    for name, colour in colours(detectors).items():
        numbers = detectors[name]
        steps = np.array(numbers["score, recall, precision"], float).reshape(-1, 3)
        tenths = np.array(numbers["boxes, mean score, share right"], float)
        has_scores = len(steps) > 1
        left.plot(*100 * steps[:, 1:].T, "-" if has_scores else "o", color=colour)
        for end in steps[-1:, 1:]:
            look = {"ha": "center", "va": "top", "color": colour, "size": 9}
            left.annotate(name, 100 * end, (0, -6), textcoords="offset points", **look)
        if has_scores:
            _, sure, hits = tenths[tenths[:, 0] >= _FEWEST].T
            right.plot(sure, hits, marker="o", markersize=5, color=colour)
    right.plot([0, 1], [0, 1], "--", color=CALM, linewidth=1, zorder=0)
    for axes, along, up, limit in (
        (left, "recall (% of objects in range)", "precision (% of boxes)", 102),
        (right, "mean score of a tenth", "share of its boxes that is right", 1.02),
    ):
        axes.set(xlabel=along, ylabel=up, xlim=(0, limit), ylim=(0, limit))
        axes.grid(True)
    return figure
