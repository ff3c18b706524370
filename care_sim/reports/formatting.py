"""How measured values are written in tables."""

from collections.abc import Iterable

from care_sim.evaluation.bootstrap import Interval
from care_sim.evaluation.censoring import Quartiles
from care_sim.reports.contrasts import Contrast
from care_sim.reports.table import Bold

NOT_DETECTED = "not detected"
MARKS = {"privileged": "†", "non-causal": "‡", "generator": "§"}
"""Marks of the policies that no car can have."""
MEANINGS = {
    "privileged": "† knows the truth: no policy of a car.",
    "non-causal": "‡ saw the full scan first: saves no sensing.",
    "generator": "§ looks the episode up in the public generator: a warning, no contender.",
}


def marked(policy: str, tags: tuple[str, ...]) -> str:
    """The policy, with a mark when no car can have it."""
    marks = "".join(mark for tag, mark in MARKS.items() if tag in tags)
    return f"{policy} {marks}".rstrip()


def tag_notes(tags: Iterable[tuple[str, ...]]) -> tuple[str, ...]:
    """What the marks of policies with these tags mean."""
    held = {tag for each in tags for tag in each}
    return tuple(meaning for tag, meaning in MEANINGS.items() if tag in held)


def median(values: Quartiles | None) -> str:
    """A median detection distance."""
    if values is None:
        return "-"
    return NOT_DETECTED if values.median is None else f"{values.median:.1f}"


def quarters(values: Quartiles) -> str:
    """The quartiles around a median detection distance; empty where all three are not detected."""
    if values.high is None:
        return ""
    low, high = ("n.d." if value is None else f"{value:.1f}" for value in (values.low, values.high))
    return f"[{low}, {high}]"


def spread(values: Quartiles) -> str:
    """A median detection distance with its quartiles."""
    return f"{median(values)} {quarters(values)}".rstrip()


def mean(contrast: Contrast | None) -> str:
    """A mean difference without its interval: bold and with an asterisk where that is earned."""
    return _weighed(contrast, _mean(contrast)) if contrast else ""


def interval(contrast: Contrast | None) -> str:
    """A mean difference with its interval: bold and with an asterisk where that is earned."""
    return _weighed(contrast, f"{_mean(contrast)} {ends(contrast)}") if contrast else ""


def unsigned(contrast: Contrast | None) -> str:
    """A mean difference that is zero at best."""
    return f"{contrast.difference.bound}{contrast.mean:z.1f}" if contrast else ""


def ends(contrast: Contrast) -> str:
    """The interval of a difference."""
    return bounds(contrast.difference.interval, contrast.measure.decimals)


def bounds(interval: Interval, decimals: int) -> str:
    """The ends of an interval; one that would round to zero has one decimal more."""
    return f"[{_end(interval.low, decimals)},{_end(interval.high, decimals)}]"


def _end(end: float, decimals: int) -> str:
    hidden = round(end, decimals) == 0 != round(end, decimals + 1)
    return f"{end:z.{decimals + hidden}f}"


def _mean(contrast: Contrast) -> str:
    star = "*" if contrast.counts else ""
    return f"{contrast.difference.bound}{contrast.mean:+z.{contrast.measure.decimals}f}{star}"


def _weighed(contrast: Contrast, text: str) -> str:
    return Bold(text) if contrast.excludes_zero else text
