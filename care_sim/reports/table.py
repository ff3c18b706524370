"""A table of text, for a file in Markdown and for a terminal; `care_sim.reports.report` sets it in
LaTeX.
"""

import re
from dataclasses import dataclass, replace

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderResult
from rich.segment import Segment
from rich.table import Table as RichTable
from rich.text import Text

from care_sim.base.errors import printable

TableRow = tuple[str, ...]
_MARKDOWN = re.compile(r"[\\`*|~]|(?<!\w)_|_(?!\w)|<(?=[A-Za-z/!?])|&(?=#?\w+;)|(?<=\])\(")
"""Characters that Markdown reads as marks, tags, entities or links. An underscore within a word is
none.
"""
_NUMBER = r"[≤≥~]?[+-]\d[\d.]*"
_DIFFERENCE = re.compile(rf"{_NUMBER}\*?°?( .*)?")
_MARKS = {
    rf"{_NUMBER}\*": "*: reaches the gate",
    r"[≤≥~][+-]?\d": "≤, ≥, ~: a bound, since actors were missed",
    r"\d.*°": "°: interval over events",
    r"\bn\.d\.": "n.d.: not detected",
    "†": "†: knows the truth",
    "‡": "‡: saw the full scan first",
    "§": "§: looks the episode up",
}
"""Meanings of marks, by the pattern of an entry that has the mark."""
_HEADING = "\N{BOX DRAWINGS LIGHT QUADRUPLE DASH HORIZONTAL}"
"""Stands in a terminal's grid for the row of a heading."""
_LONGEST_NAME = 30
_SENTENCE = 24
"""Characters of a name, and of any other entry, from which on a terminal breaks it."""
_BOLD = "Bold: the interval excludes 0"


class Bold(str):
    """Text to be set in bold."""

    __slots__ = ()


@dataclass(frozen=True)
class Table:
    """Entries of text under a title, with notes below.

    A row of one entry is a heading for the rows after it. A terminal leaves out the `quotes`, the
    columns named in `files_only` and empty columns. It breaks entries of the columns in `whole`
    last. A page folds a table without `terminal`: details. The first `names` columns name the rows.
    Names in texts may be anybody's: control codes are shown as escapes.
    """

    title: str
    columns: TableRow
    rows: tuple[TableRow, ...]
    notes: tuple[str, ...] = ()
    quotes: tuple[str, ...] = ()
    files_only: tuple[str, ...] = ()
    whole: tuple[str, ...] = ()
    terminal: bool = True
    names: int = 1

    def __post_init__(self) -> None:
        # A frozen dataclass sets its fields this way. Every text is made printable here, once, so
        # that no output can forget it.
        object.__setattr__(self, "title", printable(self.title))
        object.__setattr__(self, "rows", tuple(map(_shown, self.rows)))
        object.__setattr__(self, "notes", tuple(filter(None, self.notes)))
        for name in ("columns", "notes", "quotes", "files_only", "whole"):
            object.__setattr__(self, name, _shown(getattr(self, name)))

    @property
    def lines(self) -> tuple[str, ...]:
        """The notes, then the meanings of the marks in the entries that no note explains."""
        told = " ".join(self.notes)
        entries = [entry for row in self.rows for entry in row]
        marks = [
            meaning
            for pattern, meaning in _MARKS.items()
            if re.split("[:,]", meaning)[0] not in told
            and any(re.search(pattern, entry) for entry in entries)
        ]
        # Bold words mean something else, which their own tables explain.
        if any(isinstance(entry, Bold) and _DIFFERENCE.fullmatch(entry) for entry in entries):
            marks.insert(0, _BOLD)
        return (*self.notes, f"{'; '.join(marks)}.") if marks else self.notes

    def rich(self) -> "TerminalTable":
        """For a terminal."""
        return TerminalTable(self)

    def markdown(self) -> str:
        """For a file."""
        rows = [tuple(map(unmarked, self.columns)), tuple("---" for _ in self.columns)]
        rows += map(self._markdown_row, self.rows)
        body = "\n".join(f"| {' | '.join(row)} |" for row in rows)
        texts = [f"## {unmarked(self.title)}", body, *map(unmarked, (*self.lines, *self.quotes))]
        return "\n\n".join(texts) + "\n"

    def without_empty_columns(self) -> "Table":
        """The same without the columns in which nothing stands; those of names stay."""
        filled = [n for n in range(len(self.columns)) if n < self.names or any(self.entries(n))]
        rows = tuple(row if len(row) == 1 else tuple(row[n] for n in filled) for row in self.rows)
        return replace(self, columns=tuple(self.columns[n] for n in filled), rows=rows)

    def entries(self, column: int) -> list[str]:
        """Return the entries of a column; headings of rows span them all."""
        return [row[column] for row in self.rows if len(row) > 1]

    def _markdown_row(self, row: TableRow) -> TableRow:
        if len(row) == 1:
            return (f"*{unmarked(row[0])}*", *("" for _ in self.columns[1:]))
        return tuple(
            f"**{unmarked(entry)}**" if isinstance(entry, Bold) else unmarked(entry)
            for entry in row
        )


@dataclass(frozen=True)
class TerminalTable:
    """A table as a terminal shows it."""

    table: Table

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        yield Text(self.table.title, "italic")
        for number, part in enumerate(self._parts(options.max_width)):
            if number:
                yield Segment.line()
            yield from self._part(part, console, options)
        for note in self.table.lines:
            yield Text(note, "dim")

    def _parts(self, width: int) -> list[list[int]]:
        """The columns that stand side by side: a table that is too wide goes on below itself, with
        its names again. Folded, a number would be another number.
        """
        table = self.table
        shown = [
            n
            for n, name in enumerate(table.columns)
            if name not in table.files_only and any(table.entries(n))
        ]
        names = [n for n in shown if n < table.names]
        parts: list[list[int]] = [[]]
        for n in shown[len(names) :]:
            if parts[-1] and sum(map(self._width, [*names, *parts[-1], n])) > width:
                parts.append([])
            parts[-1].append(n)
        return [[*names, *part] for part in parts]

    def _width(self, column: int) -> int:
        """Characters of a column and the space behind it. Sentences are broken, and long names."""
        table = self.table
        entries = table.entries(column)
        if not (column < table.names or table.columns[column] in table.whole):
            entries = [
                word
                for entry in entries
                for word in (entry.split() if cell_len(entry) > _SENTENCE else [entry])
            ]
        words = [*table.columns[column].split(), *entries]
        return 1 + min(max(map(cell_len, words)), _LONGEST_NAME)

    def _part(self, columns: list[int], console: Console, options: ConsoleOptions) -> RenderResult:
        table = self.table
        grid = RichTable(box=None, padding=(0, 1, 0, 0), header_style="")
        widths = [self._width(n) for n in columns]
        left = options.max_width - sum(widths)
        for place, n in enumerate(columns):
            # Entries and headings that are broken get the width that is left, from left to right.
            longest = max(map(cell_len, [table.columns[n], *table.entries(n)]))
            more = min(max(longest + 1 - widths[place], 0), max(left, 0))
            widths[place] += more
            left -= more
            width = widths[place] - 1 if left >= 0 else None
            grid.add_column(Text(table.columns[n]), overflow="fold", width=width)
        for row in table.rows:
            cells = [_HEADING] if len(row) == 1 else [Text(row[n], _style(row[n])) for n in columns]
            grid.add_row(*cells)
        headings = (row[0] for row in table.rows if len(row) == 1)
        for line in console.render_lines(grid, options, pad=False):
            # Rich has no cells that span columns: a heading takes the line of its row.
            if "".join(segment.text for segment in line).strip() == _HEADING:
                yield Text(next(headings), "italic")
            else:
                yield from [*line, Segment.line()]


def unmarked(text: str) -> str:
    """The text with what Markdown would read as marks taken literally."""
    return _MARKDOWN.sub(r"\\\g<0>", text)


def _shown(texts: TableRow) -> TableRow:
    # The type of the text is kept, because Bold is a type.
    return tuple(text if text.isprintable() else type(text)(printable(text)) for text in texts)


def _style(entry: str) -> str:
    return "bold" if isinstance(entry, Bold) else ""
