"""Tables of a study as a page holds them: blocks of rows, and the number by which each entry is
sorted.
"""

import re
from dataclasses import dataclass

from care_sim.reports.formatting import NOT_DETECTED
from care_sim.reports.protocol.formatting import PAPER
from care_sim.reports.table import Bold, Table

_NUMBER = re.compile(r"[≤≥~]?([+-]?\d+(?:\.\d+)?)(?=[ %*°]|$)")
_SHARE = re.compile(r"(\d+)/(\d+)")
_BREAK = re.compile(r"\s+|(?<=[a-z]-)")
"""Where a browser may begin a new line."""
_NARROW, _WIDE = frozenset(" .,:;!|'()[]-/ijl"), frozenset("mwMW%@±≠≤≥")
_NARROW_EMS, _USUAL_EMS, _WIDE_EMS, _BOLD = 0.4, 0.65, 1.0, 1.1
"""Widths of characters, of a wide font: DejaVu Sans has digits of 0.64 em, bold ones of 0.70."""
_APART_EMS = 0.6
"""Between two columns."""


@dataclass(frozen=True)
class Entry:
    """Text; `key` is the number by which it is sorted, None for words."""

    text: str
    bold: bool
    key: float | None


@dataclass(frozen=True)
class Line:
    """A row. An `attached` one holds the paper's numbers, belongs to the row above it and moves
    with it.
    """

    entries: tuple[Entry, ...]
    attached: bool


@dataclass(frozen=True)
class Block:
    """Rows that are sorted among themselves, under a heading of their own where they have one."""

    heading: str
    lines: tuple[Line, ...]


def blocks(table: Table) -> list[Block]:
    """The rows of a table by the headings among them."""
    parts: list[tuple[str, list[Line]]] = [("", [])]
    for row in table.rows:
        if len(row) == 1 < len(table.columns):
            parts.append((row[0], []))
        else:
            entries = tuple(
                Entry(str(text), isinstance(text, Bold), sort_key(text)) for text in row
            )
            parts[-1][1].append(Line(entries, attached=PAPER in row[:2] and bool(parts[-1][1])))
    return [Block(heading, tuple(lines)) for heading, lines in parts if heading or lines]


def least_ems(table: Table) -> float:
    """The width below which columns of the table would be cut, in heights of its letters: that of
    the longest word of every column.
    """
    whole = [row for row in table.rows if len(row) == len(table.columns)]
    columns = zip(map(Bold, table.columns), *whole, strict=True)
    return sum(max(map(_longest_ems, column)) + _APART_EMS for column in columns)


def _longest_ems(text: object) -> float:
    weight = _BOLD if isinstance(text, Bold) else 1.0
    return weight * max(map(_ems, _BREAK.split(str(text))))


def _ems(word: str) -> float:
    return sum(
        _NARROW_EMS if sign in _NARROW else _WIDE_EMS if sign in _WIDE else _USUAL_EMS
        for sign in word
    )


def sort_key(text: str) -> float | None:
    """The number that an entry begins with, the value of a share as k/n, and the least for what was
    never detected.
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
