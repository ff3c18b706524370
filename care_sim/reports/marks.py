"""The marks of a table's entries, explained in a line; captions and notes tell more of each."""

import re
from collections.abc import Iterable, Sequence

_NUMBER = r"[≤≥~]?[+-]\d[\d.]*"
"""A difference as tables have it, with what says that it is a bound."""
_DIFFERENCE = re.compile(rf"{_NUMBER}\*?°?( \[.*)?")
_SHORT = {
    r"[≤≥~][+-]?\d": "≤, ≥, ~: a bound, since actors were missed",
    rf"{_NUMBER}\*": "*: reaches the gate stated in advance",
    r"\d.*°": "°: interval of events, not of scenes",
    r"\bn\.d\.": "n.d.: not detected",
    "†": "†: knows the truth",
    "‡": "‡: saw the full scan first",
    "§": "§: looks the episode up",
}
"""By what an entry holds that has the mark."""
_EXCLUDES_ZERO = "bold: the interval excludes zero"


def marks_in_short(entries: Sequence[str], bold: Iterable[str], told: str = "") -> str:
    """What the marks among the entries mean, and bold type where differences among those that are
    `bold` have it, but for marks that the text `told` explains; empty without any.
    """
    marks = [
        words
        for pattern, words in _SHORT.items()
        if words[0] not in told and any(re.search(pattern, entry) for entry in entries)
    ]
    # Of words bold type says something else, which their own tables tell.
    if any(map(_DIFFERENCE.fullmatch, bold)):
        marks.insert(0, _EXCLUDES_ZERO)
    return f"{'; '.join(marks)}." if marks else ""
