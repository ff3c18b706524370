"""How the protocol's numbers are written in tables."""

from care_sim.evaluation.scene_contrasts import Ratio
from care_sim.reports.formatting import emphasised, mean, signed
from care_sim.reports.protocol.differences import MeasuredDifference, decimals_of

PAPER = "(paper)"
"""What the line under a policy begins with that holds the paper's numbers."""
MET = "met"
NOT_MET = "not met"
UNDECIDED = "undecided"


def written(ratio: Ratio, value: float | None) -> str:
    """A level in the unit of its measure."""
    return "" if value is None else f"{value:.{decimals_of(ratio)}f}"


def verdict(difference: MeasuredDifference, claimed: int) -> str:
    """Whether a claim holds: 1 or -1 for a sign, 0 for a tie."""
    if difference.interval is None:
        return UNDECIDED
    if difference.sign == claimed:
        return MET
    return NOT_MET if difference.sign else UNDECIDED


def judged(difference: MeasuredDifference | None, claimed: int | None, paper: str) -> str:
    """A difference, whether it bears a claim out, and the claim as the paper has it; bold as `mean`
    is.
    """
    if difference is None:
        return ""
    if claimed is None:
        return mean(difference)
    text = f"{signed(difference)} {verdict(difference, claimed)}{difference.suffix} ({paper})"
    return emphasised(difference, text)
