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
