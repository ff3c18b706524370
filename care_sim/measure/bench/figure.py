"""The growth curves: time of a scan against budget, bodies and cells of the grid."""

from itertools import cycle

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from care_sim.measure.bench.ratios import BenchReport

AXES = {
    "budget": "budget (share of cells fired)",
    "bodies": "bodies",
    "grid": "grid (columns x rows), same rays",
}
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")
"""From the palette of Okabe and Ito (2008), safe for the colour-blind."""
_MARKERS = "osD^v"


def growth_figure(report: BenchReport) -> Figure:
    """One panel per axis and one line per engine; both scales are logarithmic."""
    figure = Figure(figsize=(10.0, 3.4), layout="constrained")
    panels = figure.subplots(1, len(AXES), sharey=True)
    for axes, (name, label) in zip(panels, AXES.items(), strict=True):
        _draw(axes, report["growth"][name]["values"], report["growth"][name]["ms"])
        axes.set_xticks(report["growth"][name]["values"], report["growth"][name]["labels"])
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_xlabel(label)
    panels[0].set_ylabel("a scan, poses included (ms)")
    panels[0].legend(frameon=False, fontsize=8)
    scans, place = report["scans"], report["machine"]
    title = (
        f"{scans['bodies']} bodies and {scans['rays']} rays unless the axis says otherwise. "
        f"{place['processor']}"
    )
    figure.suptitle(title, x=0.01, ha="left", fontsize=8)
    return figure


def _draw(axes: Axes, values: list[float], curves: dict[str, list[float]]) -> None:
    for (engine, times), colour, marker in zip(
        curves.items(), cycle(_COLOURS), cycle(_MARKERS), strict=False
    ):
        axes.loglog(values, times, marker=marker, color=colour, label=engine, markersize=4)
    axes.grid(which="major", linewidth=0.4, alpha=0.5)
