"""Which of two policies leads under every condition, and what that makes of the order under ideal
ones.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

from care_sim.evaluation.censoring import FEWEST_PAIRS
from care_sim.reports.engine.contrasts import Contrast
from care_sim.study.designs.realism import IDEAL, Pair


class Standing(NamedTuple):
    """How the first of two policies stands to the second; `sign` is 1 or -1 where the interval of
    the difference excludes zero, else 0, and None of fewer pairs than carry a claim.
    """

    difference: Contrast
    sign: int | None


def standing_of(contrast: Contrast) -> Standing:
    """How the first of the two policies of a contrast stands to the second."""
    enough = contrast.difference.pairs >= FEWEST_PAIRS
    return Standing(contrast, contrast.sign if enough else None)


class Verdict(StrEnum):
    """What a condition makes of an order."""

    HOLDS = "holds"
    LOST = "lost"
    FLIPS = "flips"
    TIED = "tied"
    ARISES = "arises"


CHANGED = (Verdict.FLIPS, Verdict.LOST, Verdict.ARISES)


@dataclass(frozen=True)
class Order:
    """Two policies in a headline table, by the labels of the conditions that were played."""

    headline: str
    pair: Pair
    standings: Mapping[str, Standing]

    @property
    def label(self) -> str:
        """The headline table and the two policies."""
        return f"{self.headline}: {' : '.join(self.pair)}"

    def verdict(self, condition: str) -> Verdict | None:
        """None where one of the two was not played, or rests on too few pairs."""
        signs = [
            standing.sign if (standing := self.standings.get(each)) else None
            for each in (IDEAL.label, condition)
        ]
        if condition == IDEAL.label or None in signs:
            return None
        before, here = signs
        if not before:
            return Verdict.ARISES if here else Verdict.TIED
        if not here:
            return Verdict.LOST
        return Verdict.HOLDS if here == before else Verdict.FLIPS


class Change(NamedTuple):
    """An order that is another under a condition."""

    order: Order
    condition: str
    verdict: Verdict


def changes(orders: Sequence[Order]) -> Iterator[Change]:
    """Those that flip, those that are lost, then leads where there was a tie."""
    for verdict in CHANGED:
        for order in orders:
            for condition in order.standings:
                if order.verdict(condition) is verdict:
                    yield Change(order, condition, verdict)
