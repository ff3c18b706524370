"""The figure of detectors: precision against recall, and whether a score is what it says."""

from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure

from care_sim.evaluation.detector_quality import SceneBoxes, counts, curve, reliability
from care_sim.reports.detectors import has_scores
from care_sim.reports.figures.styles import CALM, colours, default_style, name_ends

DETECTORS_FIGURE = "detectors"
_FEWEST = 20
"""Boxes in a tenth of scores, for its share to be drawn."""


@default_style()
def detectors_figure(boxes: Mapping[str, Sequence[SceneBoxes]]) -> Figure:
    """A line for every detector with scores, a point for every other."""
    figure = Figure(figsize=(9.2, 4.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    ends = {}
    for name, colour in colours(boxes).items():
        scenes = boxes[name]
        if has_scores(scenes):
            _, recall, precision = curve(scenes).T
            left.plot(100 * recall, 100 * precision, color=colour, label=name)
            ends[name] = float(100 * precision[-1]), colour
            tenths = reliability(scenes)
            _, sure, hits = tenths[tenths[:, 0] >= _FEWEST].T
            right.plot(sure, hits, marker="o", markersize=5, color=colour, label=name)
        else:
            found = counts(scenes)
            at = [100 * found.recall], [100 * found.precision]
            left.plot(*at, "o", color=colour, label=name)
            ends[name] = 100 * found.precision, colour
    right.plot([0, 1], [0, 1], "--", color=CALM, linewidth=1, zorder=0)
    for axes, along, up, end in (
        (left, "recall (% of objects in range)", "precision (% of boxes)", 102),
        (right, "mean score of a tenth", "share of its boxes that is right", 1.02),
    ):
        axes.set(xlabel=along, ylabel=up, xlim=(0, end), ylim=(0, end))
        axes.grid(axis="both")
    name_ends(figure, {left: ends})
    return figure
