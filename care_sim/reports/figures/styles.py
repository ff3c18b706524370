"""Colours, markers and lines of policies, the same in every figure."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import cycle
from typing import Literal, NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from care_sim.reports.formatting import MARKS


@dataclass(frozen=True)
class Style:
    """How a policy is drawn."""

    colour: str
    marker: str
    line: str = "-"


_KNOWN = {
    "history": ("#E69F00", "s"),
    "history-uniform": ("#882255", "<"),
    "all-camera": ("#D55E00", "v"),
    "care": ("#0072B2", "o"),
    "care-sbf": ("#009E73", "D"),
    "care-priority": ("#56B4E9", "^"),
    "uncertainty": ("#CC79A7", "P"),
    "beam-reduce": ("#332288", ">"),
    "random": ("#999933", "X"),
    "learned-scorer": ("#117733", "p"),
    "learned-sets": ("#1B7837", "3"),
    "ppo": ("#AA4499", "h"),
    "ppo-dartout": ("#661100", "*"),
    "care-sightlines": ("#000000", "d"),
    "care-spread": ("#6699CC", "H"),
    "care-sector": ("#AA3377", "1"),
    "rows": ("#CC6677", "x"),
    "place": ("#44AA99", "+"),
    "place-hulls": ("#BB5566", "2"),
    "fan": ("#BBAA33", "8"),
}
"""From the palettes of Okabe and Ito (2008) and of Tol (2021), both safe for the colour-blind. No
two have one marker. `rows`, `place`, `place-hulls` and `care-sector` have thin ones, since
Matplotlib has too few to fill; a closed loop, whose figures leave markers open, plays `fan`.
"""
_SPARE = ("#88CCEE", "#DDCC77", "#EE8866", "#AAAA00", "#77AADD")
_GREYS = ("0.3", "0.45", "0.6")
_MARKERS = ("H", "8", "d", "s", "^")
FULL_STYLE = Style("0.35", "_", "--")


APART = "policies are drawn a little apart sideways, so that equal points stay visible"
_LEGEND_LINE_INCHES = 0.204
_LEGEND_FRAME_INCHES = 0.35


class Dodge(NamedTuple):
    """How far the curves of policies are moved apart sideways, so that equal ones stay visible.

    Shares of a budget: between `neighbours`, and from the first policy to the last at most `total`.
    """

    neighbours: float
    total: float

    def factor(self, number: int, count: int) -> float:
        """The factor on the budgets of policy `number` of `count`; 1 for the one in the middle."""
        # Budgets stand on a logarithmic axis, where equal factors are equal distances.
        return 1 + min(self.neighbours, self.total / count) * (number - (count - 1) / 2)


CLOSED_LOOP_DODGE = Dodge(0.03, 0.24)
OPEN_LOOP_DODGE = Dodge(0.025, 0.1)


def bare_axes(axes: Axes, grid: str, lines: Literal["both", "y"] = "y") -> None:
    """Axes without a frame above and on the right, with a pale grid behind what is drawn."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis=lines, color=grid)
    axes.set_axisbelow(True)


def name_outside(figure: Figure, panels: Sequence[Axes]) -> None:
    """A legend right of the panels with everything that any of them names, once; a figure that is
    too low for it grows.
    """
    named = {
        label: handle
        for axes in panels
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(
        named.values(), named.keys(), loc="outside right upper", frameon=False, fontsize=9
    )
    needed = _LEGEND_FRAME_INCHES + _LEGEND_LINE_INCHES * len(named)
    figure.set_figheight(max(figure.get_figheight(), needed))


def styles(policies: Iterable[tuple[str, tuple[str, ...]]]) -> dict[str, Style]:
    """A style for every policy, given with its tags. Policies that no car can have are grey and
    dashed, controls dotted.
    """
    # Policies of others get what is left, in their order; so the same study has the same colours.
    spare = cycle(_SPARE)
    greys = cycle(_GREYS)
    markers = cycle(_MARKERS)
    made = {}
    for policy, tags in policies:
        if any(tag in tags for tag in MARKS):
            # Grey and dashed, so that nobody takes them for contenders.
            made[policy] = Style(next(greys), next(markers), "--")
        else:
            colour, marker = _KNOWN.get(policy) or (next(spare), next(markers))
            made[policy] = Style(colour, marker, ":" if "control" in tags else "-")
    return made
