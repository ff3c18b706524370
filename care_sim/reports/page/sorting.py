"""By what a page sorts the entries of a table."""

import re

from care_sim.reports.formatting import NOT_DETECTED
from care_sim.reports.table import Bold

_NUMBER = re.compile(r"[≤≥~]?([+-]?\d+(?:\.\d+)?)(?=[ %*°]|$)")
_SHARE = re.compile(r"(\d+)/(\d+)")


def is_bold(text: str) -> bool:
    """Whether an entry is set in bold."""
    return isinstance(text, Bold)


def sort_key(text: str) -> float | None:
    """The number that an entry begins with, the value of a share as k/n, and the least for what was
    never detected; None for words.
    """
    # Below every distance, as medians rank it.
    if text.startswith((NOT_DETECTED, "n.d.")):
        return float("-inf")
    # k/n is a share; 0/0 is none.
    share = _SHARE.fullmatch(text)
    number = _NUMBER.match(text)
    if share and int(share[2]):
        return int(share[1]) / int(share[2])
    return float(number[1]) if number else None
