"""A table of text, and how it looks on a terminal and in Markdown; `care_sim.reports.latex` sets it
in LaTeX.
"""

import re
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.table import Table as RichTable
from rich.text import Text

from care_sim.base.errors import printable
from care_sim.reports.marks import marks_in_short

TableRow = tuple[str, ...]
_MARKS = re.compile(r"[\\`*|~]|(?<!\w)_|_(?!\w)|<(?=[A-Za-z/!?])|&(?=#?\w+;)|(?<=\])\(")
"""What Markdown reads as marks, tags, entities or links. An underscore within a word is none."""

_SENTENCE = 24
"""Characters of a column from which on a terminal breaks its entries."""
_NOTE_LINES = 3
"""Lines of notes that a terminal shows under a table, at the most."""
_CUT = " ... "
_SENTENCE_END = re.compile(r"(?<=\.) (?=[A-Z≤≥~†‡§])")


class Bold(str):
    """Text to be set in bold."""

    __slots__ = ()


@dataclass(frozen=True)
class Table:
    """Entries of text under a title, with notes below.

    A row of one entry is a heading for the rows after it. A terminal shows no `quotes`, not the
    columns named in `files_only`, no empty columns, and nothing of a table without `terminal`; of
    the columns in `whole` it breaks only the headings. Where it is too narrow the table goes on
    below itself, with its first `names` columns again. Names in its texts may be anybody's: control
    codes are shown as escapes.
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
        for name in ("columns", "notes", "quotes", "files_only", "whole"):
            object.__setattr__(self, name, _shown(getattr(self, name)))

    def rich(self, rest: Path | None = None) -> "TerminalTable":
        """For a terminal; of notes longer than three lines the first ones, and that `rest` holds
        them all.
        """
        return TerminalTable(self, rest)

    def markdown(self) -> str:
        """For a file."""
        heading = tuple(map(unmarked, self.columns))
        rule = tuple("---" for _ in self.columns)
        body = "\n".join(
            "| " + " | ".join(line) + " |"
            for line in [heading, rule, *map(self._markdown_row, self.rows)]
        )
        return (
            "\n\n".join(
                [f"## {unmarked(self.title)}", body, *map(unmarked, (*self.notes, *self.quotes))]
            )
            + "\n"
        )

    def without_empty_columns(self) -> "Table":
        """The same without the columns in which nothing stands; those of names stay."""
        filled = [n for n in range(len(self.columns)) if n < self.names or any(self.entries(n))]
        rows = tuple(row if len(row) == 1 else tuple(row[n] for n in filled) for row in self.rows)
        return replace(self, columns=tuple(self.columns[n] for n in filled), rows=rows)

    def entries(self, column: int) -> list[str]:
        """What stands in a column; headings of rows span them all."""
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
    """A table as a terminal shows it, whatever its width."""

    table: Table
    rest: Path | None = None

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        yield Text(self.table.title, style="italic")
        parts = self._parts(options.max_width)
        for number, columns in enumerate(parts):
            if number:
                yield Text()
            rows = self._told_in(columns) if len(parts) > 1 else self.table.rows
            yield from self._part(columns, rows, options.max_width)
        told = brief(self.table.notes, options.max_width, self.rest)
        for words in (told, self._marks(told)):
            if words:
                yield Text(words, style="dim")

    def _marks(self, told: str) -> str:
        """What the marks mean of the entries that are shown, where the text does not say it."""
        columns = [n for n in range(len(self.table.columns)) if self._is_shown(n)]
        entries = [entry for n in columns for entry in self.table.entries(n)]
        return marks_in_short(entries, [e for e in entries if isinstance(e, Bold)], told)

    def _parts(self, width: int) -> list[list[int]]:
        """The columns that stand side by side, part by part."""
        table = self.table
        names = [n for n in range(table.names) if self._is_shown(n)]
        parts: list[list[int]] = [[]]
        for block in self._blocks():
            beside = [*names, *parts[-1], *block]
            if parts[-1] and sum(map(self._width, beside)) > width:
                parts.append([])
            parts[-1] += block
        return [[*names, *part] for part in parts]

    def _is_shown(self, column: int) -> bool:
        table = self.table
        return table.columns[column] not in table.files_only and any(table.entries(column))

    def _blocks(self) -> list[list[int]]:
        """The columns behind the names, together those that are not parted: a heading that comes
        again, such as `difference`, says something beside the one before it alone.
        """
        columns = self.table.columns
        blocks: list[list[int]] = []
        for n in range(self.table.names, len(columns)):
            if blocks and columns.count(columns[n]) > 1:
                blocks[-1].append(n)
            else:
                blocks.append([n])
        return [shown for block in blocks if (shown := [n for n in block if self._is_shown(n)])]

    def _width(self, column: int) -> int:
        """Characters of a column and the space after it: entries of sentences are broken."""
        name = self.table.columns[column]
        entries = self.table.entries(column)
        longest = max(map(cell_len, entries), default=0)
        words = name.split()
        if name not in self.table.whole and longest > _SENTENCE:
            longest = _SENTENCE
            words += [word for entry in entries for word in entry.split()]
        return 1 + max([longest, *map(cell_len, words)])

    def _widths(self, columns: Sequence[int], width: int) -> list[int]:
        """The widths of columns that stand side by side: what is left goes to broken entries, then
        to broken headings.
        """
        table = self.table
        widths = [self._width(n) for n in columns]
        left = width - sum(widths)
        entries = [max(map(cell_len, table.entries(n)), default=0) for n in columns]
        headings = [
            0 if table.columns[n] in table.whole else cell_len(table.columns[n]) for n in columns
        ]
        for wanted in (entries, headings):
            for place, longest in enumerate(wanted):
                more = min(max(longest + 1 - widths[place], 0), max(left, 0))
                widths[place] += more
                left -= more
        return widths

    def _told_in(self, columns: Sequence[int]) -> list[TableRow]:
        """The rows of which these columns tell something, under their headings."""
        told: list[TableRow] = []
        heading: TableRow | None = None
        for row in self.table.rows:
            if len(row) == 1:
                heading = row
            elif any(row[n] for n in columns if n >= self.table.names):
                told += [heading, row] if heading else [row]
                heading = None
        return told

    def _part(
        self, columns: Sequence[int], rows: Sequence[TableRow], width: int
    ) -> Iterator[RenderableType]:
        """Columns side by side. Headings of rows span them, and part the rows in several tables of
        the same widths.
        """
        if columns:
            yield self._block(columns, width, show_header=True)
        block = self._block(columns, width)
        for row in rows:
            if len(row) == 1:
                if block.row_count:
                    yield block
                yield _styled(row[0], heading=True)
                block = self._block(columns, width)
            else:
                block.add_row(*(_styled(row[n], heading=False) for n in columns))
        if block.row_count:
            yield block

    def _block(self, columns: Sequence[int], width: int, show_header: bool = False) -> RichTable:
        block = RichTable(box=None, padding=(0, 1, 0, 0), show_header=show_header)
        widths = self._widths(columns, width)
        fits = sum(widths) <= width
        for n, wide in zip(columns, widths, strict=True):
            name = self.table.columns[n]
            # One word per line keeps columns narrow whose entries must not break.
            whole = name in self.table.whole
            block.add_column(
                Text(name.replace(" ", "\n") if whole else name),
                no_wrap=whole and fits,
                overflow="fold",
                vertical="bottom" if show_header else "top",
                width=wide - 1 if fits else None,
            )
        return block


def brief(texts: Sequence[str], width: int, rest: Path | None) -> str:
    """The texts in lines of `width`. Where they take more than three and `rest` holds them all, the
    first sentences of them, and that it does.
    """
    whole = textwrap.wrap(" ".join(texts), width)
    if rest is None or len(whole) <= _NOTE_LINES:
        return "\n".join(whole)
    # A folder may have a name that leaves a line no room for anything else.
    names = [f"More: {printable(str(path))}" for path in (rest, rest.name)]
    more = next((name for name in names if len(name) <= width - len(_CUT)), "")
    sentences = _SENTENCE_END.split(" ".join(texts))
    for count in range(len(sentences) - 1, 0, -1):
        lines = textwrap.wrap(" ".join([*sentences[:count], more]), width)
        if len(lines) <= _NOTE_LINES:
            return "\n".join(lines)
    return textwrap.fill(sentences[0], width, max_lines=_NOTE_LINES, placeholder=f"{_CUT}{more}")


def unmarked(text: str) -> str:
    """The text with what Markdown would read as marks taken literally."""
    return _MARKS.sub(r"\\\g<0>", text)


def _shown(texts: TableRow) -> TableRow:
    # The type of the text is kept, because Bold is a type.
    return tuple(text if text.isprintable() else type(text)(printable(text)) for text in texts)


def _styled(entry: str, heading: bool) -> Text:
    return Text(entry, style="italic" if heading else "bold" if isinstance(entry, Bold) else "")
