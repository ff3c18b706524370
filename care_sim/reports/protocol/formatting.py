"""How the protocol's numbers are written in tables."""

from care_sim.evaluation.scene_contrasts import TTFD, Ratio
from care_sim.reports.formatting import bounds
from care_sim.reports.protocol.differences import MeasuredDifference
from care_sim.reports.table import Bold

PAPER = "(paper)"
"""What the line under a policy begins with that holds the paper's numbers."""
MET = "met"
NOT_MET = "not met"
UNDECIDED = "undecided"
OVER_EVENTS = "°"
"""Ends what rests on an interval over events."""


def written(ratio: Ratio, value: float | None) -> str:
    """A level in the unit of its measure."""
    return "" if value is None else f"{value:.{_decimals(ratio)}f}"


def mean(difference: MeasuredDifference | None) -> str:
    """A difference without its interval, bold where that excludes zero."""
    return _weighed(difference, f"{_mean(difference)}{_mark(difference)}") if difference else ""


def interval(difference: MeasuredDifference | None) -> str:
    """The interval alone."""
    return (
        f"{bounds(difference.interval, _decimals(difference.ratio))}{_mark(difference)}"
        if difference and difference.interval
        else ""
    )


def whole(difference: MeasuredDifference | None) -> str:
    """A difference with its interval, bold where that excludes zero."""
    return (
        _weighed(difference, f"{_mean(difference)} {interval(difference)}".rstrip())
        if difference
        else ""
    )


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
    return _weighed(
        difference,
        f"{_mean(difference)} {verdict(difference, claimed)}{_mark(difference)} ({paper})",
    )


def _mean(difference: MeasuredDifference) -> str:
    return f"{difference.mean:+z.{_decimals(difference.ratio)}f}"


def _mark(difference: MeasuredDifference) -> str:
    return OVER_EVENTS if difference.over_events else ""


def _weighed(difference: MeasuredDifference, text: str) -> str:
    return Bold(text) if difference.sign else text


def _decimals(ratio: Ratio) -> int:
    return 2 if ratio is TTFD else 1
