"""The figure of a comparison: how many rays end otherwise, by what they meet."""

from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from care_sim.measure.parity.tally import GROUPS, REFERENCE_NAMES
from care_sim.measure.parity.verdicts import SAME, VERDICTS
from care_sim.reports.figures.files import default_style

_STYLES = dict(zip(REFERENCE_NAMES, (("#0072B2", "o"), ("#D55E00", "D")), strict=True))
"""Of the palette of Okabe and Ito (2008), safe for the colour-blind."""
_KEYFRAMES = "keyframes of the scenarios"


@default_style()
def parity_figure(report: dict[str, Any]) -> Figure:
    """Rays in a million to which `fast` answers otherwise than either reference, a panel for random
    scenes and one for the keyframes of all scenarios; one of them must have been compared. Kinds
    that no ray meets have no marker.
    """
    random = {name: own for name, own in report["scans"].items() if name.startswith("random")}
    played = [own for name, own in report["scans"].items() if name not in random]
    panels = {name: [own] for name, own in random.items()}
    panels |= {_KEYFRAMES: played} if played else {}
    figure = Figure(figsize=(9.2, 3.4), layout="constrained")
    row = figure.subplots(1, len(panels), squeeze=False, sharex=True, sharey=True)[0]
    for axes, (title, scans) in zip(row, panels.items(), strict=True):
        axes.set_title(f"{title}: {sum(own['scans'] for own in scans):,} scans", loc="left")
        _draw(axes, scans)
    row[0].set_yticks(range(len(GROUPS)), GROUPS)
    row[0].set_ylim(len(GROUPS) - 0.5, -0.5)
    figure.supxlabel("rays in a million that fast answers otherwise (at 0: none)", fontsize=10)
    names = row[0].get_legend_handles_labels()
    figure.legend(*names, loc="outside upper right", ncols=len(_STYLES), frameon=False)
    return figure


def _draw(axes: Axes, scans: list[dict[str, Any]]) -> None:
    """A marker a reference at every kind of body that any ray meets."""
    # Shares span seven powers of ten, and none is a result too: one ray of all that are cast stands
    # apart from it.
    axes.set_xscale("symlog", linthresh=0.01)
    for reference, (colour, marker) in _STYLES.items():
        heights = dict[int, float]()
        for place, group in enumerate(GROUPS):
            met = [own["references"][reference][group] for own in scans]
            if rays := sum(counts["rays"] for counts in met):
                differing = rays - sum(counts[VERDICTS[SAME]] for counts in met)
                heights[place] = 1e6 * differing / rays
        axes.plot(
            list(heights.values()),
            list(heights),
            marker,
            color=colour,
            markerfacecolor="none" if marker == "D" else colour,
            label=f"than {reference}",
            clip_on=False,
        )
    axes.grid(axis="both")
    axes.set_xlim(0, 1e6)
