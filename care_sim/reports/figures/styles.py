"""The one style of all figures: readable on a light and on a dark page, on a transparent ground."""

from collections.abc import Iterable
from itertools import cycle
from typing import Any

INK = "#757575"
"""Of texts and axes: a grey with a contrast of 4.5 to white and to black alike."""
CALM = "#999999"
"""Of curves that only give the background."""
BLUE, ORANGE, GREEN, YELLOW = "#0072B2", "#D55E00", "#00946B", "#C28100"
"""From the palette of Okabe and Ito (2008), safe for the colour-blind; two are darkened, so that
names in these colours are read on white, too.
"""
STYLE: dict[Any, Any] = {
    "axes.axisbelow": True,
    "axes.edgecolor": INK,
    "axes.grid": True,
    "axes.grid.axis": "y",
    "axes.labelcolor": INK,
    "axes.labelsize": 9,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlecolor": INK,
    "axes.titlelocation": "left",
    "axes.titlesize": 9,
    "figure.titlesize": 10,
    "grid.alpha": 0.25,
    "grid.color": INK,
    "legend.fontsize": 9,
    "legend.frameon": False,
    "legend.labelcolor": INK,
    # Texts of an SVG stay texts: they can be searched, and take a third of the space.
    "svg.fonttype": "none",
    "text.color": INK,
    "xtick.color": INK,
    "xtick.labelsize": 8,
    "ytick.color": INK,
    "ytick.labelsize": 8,
}
"""Settings of Matplotlib in which every figure departs from the defaults."""
_COLOURS = {
    "full": INK,
    "full scan": INK,
    "best control": "#8F6A4E",
    "history": YELLOW,
    "all-camera": ORANGE,
    "care": BLUE,
    "care-sbf": GREEN,
    "care-priority": "#3B93C4",
    "care-sightlines": "#9B59D0",
    "care-spread": "#5B82C2",
    "care-sector": "#C2478A",
    "uncertainty": "#B5679A",
    "history-uniform": "#A8506F",
    "beam-reduce": "#7468C0",
    "random": "#8A8A22",
    "rows": "#C05A6B",
    "place": "#2E9587",
    "place-hulls": "#B45565",
    "fan": "#96862A",
    "learned-scorer": "#2E8B4A",
    "learned-sets": "#3C8F3C",
    "ppo": "#AF5BAF",
    "ppo-dartout": "#B3543C",
}
_SPARE = (GREEN, "#7468C0", "#C2478A", "#96862A", "#2E9587", "#B3543C", "#3B93C4", "#8A8A22")


def colours(policies: Iterable[str]) -> dict[str, str]:
    """The colour of every policy, the same in every figure."""
    # Policies of others get what is left, in their order; so the same study has the same colours.
    spare = cycle(_SPARE)
    return {policy: _COLOURS.get(policy) or next(spare) for policy in policies}
