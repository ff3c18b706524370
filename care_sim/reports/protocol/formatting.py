"""How the protocol's numbers are written in tables."""

from care_sim.evaluation.scene_contrasts import TTFD, Ratio
from care_sim.reports.formatting import bounds
from care_sim.reports.protocol.differences import Gap
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


def mean(gap: Gap | None) -> str:
    """A difference without its interval, bold where that excludes zero."""
    return _weighed(gap, f"{_mean(gap)}{_mark(gap)}") if gap else ""


def interval(gap: Gap | None) -> str:
    """The interval alone."""
    return (
        f"{bounds(gap.interval, _decimals(gap.ratio))}{_mark(gap)}" if gap and gap.interval else ""
    )


def whole(gap: Gap | None) -> str:
    """A difference with its interval, bold where that excludes zero."""
    return _weighed(gap, f"{_mean(gap)} {interval(gap)}".rstrip()) if gap else ""


def verdict(gap: Gap, claimed: int) -> str:
    """Whether a claim holds: 1 or -1 for a sign, 0 for a tie."""
    if gap.interval is None:
        return UNDECIDED
    if gap.sign == claimed:
        return MET
    return NOT_MET if gap.sign else UNDECIDED


def judged(gap: Gap | None, claimed: int | None, paper: str) -> str:
    """A difference, whether it bears a claim out, and the claim as the paper has it; bold as `mean`
    is.
    """
    if gap is None:
        return ""
    if claimed is None:
        return mean(gap)
    return _weighed(gap, f"{_mean(gap)} {verdict(gap, claimed)}{_mark(gap)} ({paper})")


def _mean(gap: Gap) -> str:
    return f"{gap.mean:+z.{_decimals(gap.ratio)}f}"


def _mark(gap: Gap) -> str:
    return OVER_EVENTS if gap.over_events else ""


def _weighed(gap: Gap, text: str) -> str:
    return Bold(text) if gap.sign else text


def _decimals(ratio: Ratio) -> int:
    return 2 if ratio is TTFD else 1
