"""How measured values are written in tables."""

from collections.abc import Iterable

import numpy as np

from care_sim.core.arrays import Integers
from care_sim.evaluation.bootstrap import Interval
from care_sim.evaluation.censoring import Quartiles
from care_sim.reports.engine.contrasts import Contrast
from care_sim.reports.table import Bold

NOT_DETECTED = "not detected"
MARKS = {"privileged": "†", "non-causal": "‡", "generator": "§"}
"""Marks of the policies that no car can have."""
_MEANINGS = {
    "privileged": "† knows the truth: no policy of a car.",
    "non-causal": "‡ saw the full scan first: saves no sensing.",
    "generator": "§ looks the episode up in the public generator: a warning, no contender.",
}


def marked(policy: str, tags: tuple[str, ...]) -> str:
    """The policy, with a mark when no car can have it."""
    marks = "".join(mark for tag, mark in MARKS.items() if tag in tags)
    return f"{policy} {marks}".rstrip()


def tag_notes(tags: Iterable[tuple[str, ...]]) -> tuple[str, ...]:
    """Return the notes that explain the marks of policies with these tags."""
    held = {tag for each in tags for tag in each}
    return tuple(meaning for tag, meaning in _MEANINGS.items() if tag in held)


def median(values: Quartiles | None) -> str:
    """A median detection distance; a dash without episodes that have one."""
    if values is None or not values.count:
        return "-"
    return NOT_DETECTED if values.median is None else f"{values.median:.1f}"


def quarters(values: Quartiles) -> str:
    """The quartiles around a median detection distance; empty where all three are not detected."""
    if values.high is None:
        return ""
    # Ranks grow with distance, and what was not detected ranks lowest. If the upper quartile is not
    # detected, neither are the other two.
    low, high = ("n.d." if value is None else f"{value:.1f}" for value in (values.low, values.high))
    return f"[{low}, {high}]"


def spread(values: Quartiles) -> str:
    """A median detection distance with its quartiles."""
    return f"{median(values)} {quarters(values)}".rstrip()


def spread_of_counts(counts: Integers) -> str:
    """Median, quartiles and number of counts; empty without any."""
    if not len(counts):
        return ""
    low, middle, high = np.quantile(counts, (0.25, 0.5, 0.75))
    return f"{middle:.0f} [{low:.0f}, {high:.0f}] ({len(counts)})"


def mean(difference: Contrast | None) -> str:
    """A mean difference without its interval, bold where it excludes zero."""
    if difference is None:
        return ""
    return emphasised(difference, f"{signed(difference)}{difference.suffix}")


def interval(difference: Contrast | None) -> str:
    """A mean difference with its interval if it has one, bold where it excludes zero."""
    if difference is None:
        return ""
    return emphasised(difference, f"{signed(difference)} {ends(difference)}".rstrip())


def unsigned(contrast: Contrast | None) -> str:
    """A mean difference that is zero at best."""
    # A z in the format turns a negative zero into 0.0.
    return f"{contrast.bound}{contrast.mean:z.1f}" if contrast else ""


def ends(difference: Contrast | None) -> str:
    """The interval of a difference alone; empty where there is none."""
    if difference is None or difference.interval is None:
        return ""
    return f"{bounds(difference.interval, difference.decimals)}{difference.suffix}"


def signed(difference: Contrast) -> str:
    """A mean difference with its sign and the marks beside it."""
    # Beside an interval of one sign, a mean that reads as zero has one decimal more, too.
    hides = difference.excludes_zero and _reads_as_zero(difference.mean, difference.decimals)
    number = f"{difference.mean:+z.{difference.decimals + hides}f}"
    return f"{difference.bound}{number}{difference.asterisk}"


def emphasised(difference: Contrast, text: str) -> str:
    """The text, bold where the interval of the difference excludes zero."""
    if not difference.excludes_zero:
        return text
    # A mean that reads as zero is no effect that should catch the eye.
    return text if _reads_as_zero(difference.mean, difference.decimals + 1) else Bold(text)


def bounds(interval: Interval, decimals: int) -> str:
    """The ends of an interval; one that would round to zero has one decimal more."""
    return f"[{_end(interval.low, decimals)},{_end(interval.high, decimals)}]"


def _end(end: float, decimals: int) -> str:
    # An end at 0.04 printed as 0.0 would look as if the interval held zero.
    hidden = _reads_as_zero(end, decimals) and not _reads_as_zero(end, decimals + 1)
    return f"{end:z.{decimals + hidden}f}"


def _reads_as_zero(value: float, decimals: int) -> bool:
    return round(value, decimals) == 0
