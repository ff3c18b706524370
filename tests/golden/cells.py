"""The numbers in the cells of a table, each under the texts that say what it is."""

import re
from collections.abc import Iterator
from typing import NamedTuple

from care_sim.reports.table import Table

NOT_DETECTED = "n.d."
NUMBERS = re.compile(
    r"""
    not\ detected|n\.d\.
    | [≥≤~]?                                 # a bound, or a difference of censored values
    (?:(?<![\w.])[+-] | (?<![\w=:.-])(?<![A-Za-z]/))   # no number is part of a name: drawn-0, 4x8
    (?:\d{1,3}(?:,\d{3})+(?!\d) | \d+) (?:\.\d+)? %?
    """,
    re.VERBOSE,
)
GENERIC = {"", "budget", "camera", "condition", "level", "order", "policy", "pose", "score from"}
"""Headings of columns that hold names. They say nothing about the numbers beside them."""
LABELS = GENERIC | {"fault", "recipe", "statement", "stratum", "test", "third", "vehicles"}
"""Headings of columns that name a row, even where the names are numbers."""


class Cell(NamedTuple):
    """`title` is the table's. `heading` is the row of one entry above the row, `labels` are the
    entries that name the row, `column` is the heading of the column. `numbers` are as printed.
    """

    folder: str
    title: str
    heading: str
    labels: tuple[str, ...]
    column: str
    numbers: tuple[str, ...]

    @property
    def key(self) -> tuple[str, ...]:
        """The texts without the title, sorted: the same where a table is turned on its side."""
        return tuple(sorted(filter(None, (self.heading, *self.labels, self.column))))

    @property
    def values(self) -> tuple[str, ...]:
        """The numbers without what may move into a heading: plus, percent, separators."""
        return tuple(re.sub(r"[+,%]", "", number) for number in self.numbers)


def numbers(text: str) -> tuple[str, ...]:
    """The numbers of a text as printed: with bound, sign, decimals and percent.

    A comma in brackets separates the ends of an interval, and is none of thousands.
    """
    parted = re.sub(r"\[[^]]*\]", lambda found: found[0].replace(",", ", "), text)
    found = NUMBERS.findall(parted)
    return tuple(NOT_DETECTED if number == "not detected" else number for number in found)


def cells(folder: str, table: Table) -> Iterator[Cell]:
    """The cells of a table that hold a number."""
    columns = _named_columns(table)
    names = _columns_of_names(table)
    # The heading of the first column may say more than what its entries are: "care minus".
    first = "" if columns[0] in LABELS else columns[0]
    heading = ""
    for row in table.rows:
        if len(row) == 1:
            heading = _plain(row[0])
            continue
        labels = tuple(filter(None, (first, *map(_plain, row[:names]))))
        for column, entry in zip(columns[names:], row[names:], strict=True):
            if found := numbers(entry):
                yield Cell(folder, table.title, heading, labels, column, found)


def _named_columns(table: Table) -> list[str]:
    """The headings; one that comes again stands behind the last one that does not."""
    named, before = [], ""
    for heading in map(_plain, table.columns):
        if table.columns.count(heading) > 1:
            named.append(f"{before}, {heading}")
        else:
            named.append(heading)
            before = heading
    return named


def _columns_of_names(table: Table) -> int:
    """How many of the first columns name a row."""
    count = 1
    while count < len(table.columns) and (
        count < table.names
        or table.columns[count] in LABELS
        or not any(map(numbers, table.entries(count)))
    ):
        count += 1
    return count


def _plain(text: str) -> str:
    """Text of the built-in type: entries may be bold, or members of an enumeration."""
    return str.__str__(text)
