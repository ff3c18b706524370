"""Which of two policies leads under every condition, and what that makes of the order under ideal
ones.
"""

from collections.abc import Mapping
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

    @classmethod
    def of(cls, contrast: Contrast) -> "Standing":
        """From a contrast of the two."""
        enough = contrast.difference.pairs >= FEWEST_PAIRS
        return cls(contrast, contrast.sign if enough else None)


class Verdict(StrEnum):
    """What a condition makes of an order: a lead that holds, is lost or flips; a tie that stays
    tied, or from which a lead arises.
    """

    HOLDS = "holds"
    FLIPS = "flips"
    LOST = "lost"
    ARISES = "arises"
    TIED = "tied"


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
