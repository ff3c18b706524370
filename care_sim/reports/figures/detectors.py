"""The figure of detectors: precision against recall, and whether a score is what it says."""

from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from care_sim.evaluation.detector_quality import SceneBoxes, counts, curve, reliability
from care_sim.reports.detectors import has_scores
from care_sim.reports.figures.files import default_style
from care_sim.reports.figures.styles import bare_axes

DETECTORS_FIGURE = "detectors"
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""From the palette of Okabe and Ito (2008), safe for the colour-blind."""
_MARKERS = ("o", "s", "^", "D", "v", "P")
_FEWEST = 20
"""Boxes in a tenth of scores, for its share to be drawn."""


@default_style()
def detectors_figure(boxes: Mapping[str, Sequence[SceneBoxes]]) -> Figure:
    """A line for every detector with scores, a point for every other."""
    figure = Figure(figsize=(9.2, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    for number, (name, scenes) in enumerate(boxes.items()):
        colour = _COLOURS[number % len(_COLOURS)]
        marker = _MARKERS[number % len(_MARKERS)]
        if has_scores(scenes):
            _, recall, precision = curve(scenes).T
            left.plot(100 * recall, 100 * precision, color=colour, label=name)
            tenths = reliability(scenes)
            _, sure, hits = tenths[tenths[:, 0] >= _FEWEST].T
            right.plot(sure, hits, marker=marker, markersize=5, color=colour, label=name)
        else:
            found = counts(scenes)
            left.plot(
                [100 * found.recall], [100 * found.precision], marker, color=colour, label=name
            )
    right.plot([0, 1], [0, 1], "--", color="0.6", linewidth=1, zorder=0)
    _frame(left, "recall (% of objects in range)", "precision (% of boxes)", 102)
    _frame(right, "mean score of a tenth", "share of its boxes that is right", 1.02)
    left.legend(loc="lower left")
    return figure


def _frame(axes: Axes, along: str, up: str, end: float) -> None:
    axes.set(xlabel=along, ylabel=up, xlim=(0, end), ylim=(0, end))
    bare_axes(axes, "0.93", "both")
