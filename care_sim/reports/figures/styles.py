"""Colours, markers and lines of policies, the same in every figure."""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import cycle

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
    "ppo": ("#AA4499", "h"),
    "ppo-dartout": ("#661100", "*"),
}
"""From the palettes of Okabe and Ito (2008) and of Tol (2021), both safe for the colour-blind."""
_SPARE = ("#6699CC", "#44AA99", "#CC6677", "#88CCEE", "#DDCC77")
_GREYS = ("0.3", "0.45", "0.6")
_MARKERS = ("d", "H", "8", "1", "2")
FULL_STYLE = Style("0.35", "_", "--")


def styles(policies: Iterable[tuple[str, tuple[str, ...]]]) -> dict[str, Style]:
    """A style for every policy, given with its tags; those that no car can have are grey and
    dashed.
    """
    spare = cycle(_SPARE)
    greys = cycle(_GREYS)
    markers = cycle(_MARKERS)
    made = {}
    for policy, tags in policies:
        if any(tag in tags for tag in MARKS):
            made[policy] = Style(next(greys), next(markers), "--")
        else:
            made[policy] = (
                Style(*_KNOWN[policy]) if policy in _KNOWN else Style(next(spare), next(markers))
            )
    return made
