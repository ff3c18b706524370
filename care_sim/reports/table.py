"""A table of text, and how it looks on a terminal and in Markdown; `care_sim.reports.latex` sets it
in LaTeX.
"""

import re
from dataclasses import dataclass

from rich.console import Group
from rich.table import Table as RichTable
from rich.text import Text

from care_sim.base.errors import printable

TableRow = tuple[str, ...]
_MARKS = re.compile(r"[\\`*|~]|(?<!\w)_|_(?!\w)|<(?=[A-Za-z/!?])|&(?=#?\w+;)|(?<=\])\(")
"""What Markdown reads as marks, tags, entities or links. An underscore within a word is none."""


class Bold(str):
    """Text to be set in bold."""

    __slots__ = ()


@dataclass(frozen=True)
class Table:
    """Entries of text under a title, with notes below.

    A row of one entry is a heading for the rows after it. A terminal shows no `quotes`, not the
    columns named in `files_only`, no empty columns, and nothing of a table without `terminal`; of
    the columns in `whole` it breaks only the headings. Names in its texts may be anybody's: control
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

    def __post_init__(self) -> None:
        # A frozen dataclass sets its fields this way. Every text is made printable here, once, so
        # that no output can forget it.
        object.__setattr__(self, "title", printable(self.title))
        object.__setattr__(self, "rows", tuple(map(_shown, self.rows)))
        for name in ("columns", "notes", "quotes", "files_only", "whole"):
            object.__setattr__(self, name, _shown(getattr(self, name)))

    def rich(self) -> Group:
        """For a terminal of 80 characters."""
        table = RichTable(box=None, padding=(0, 1, 0, 0))
        shown = [
            n
            for n, name in enumerate(self.columns)
            if name not in self.files_only and self._is_used(n)
        ]
        for n in shown:
            name = self.columns[n]
            # One word per line keeps columns narrow whose entries must not break.
            heading = name.replace(" ", "\n") if name in self.whole else name
            table.add_column(
                Text(heading), no_wrap=name in self.whole, overflow="fold", vertical="bottom"
            )
        for row in self.rows:
            # A heading stands in the first column alone.
            entries = row if len(row) == 1 else [row[n] for n in shown]
            table.add_row(*(_styled(entry, heading=len(row) == 1) for entry in entries))
        return Group(
            Text(self.title, style="italic"),
            table,
            *(Text(note, style="dim") for note in self.notes),
        )

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

    def _is_used(self, column: int) -> bool:
        return any(row[column] for row in self.rows if len(row) > 1)

    def _markdown_row(self, row: TableRow) -> TableRow:
        if len(row) == 1:
            return (f"*{unmarked(row[0])}*", *("" for _ in self.columns[1:]))
        return tuple(
            f"**{unmarked(entry)}**" if isinstance(entry, Bold) else unmarked(entry)
            for entry in row
        )


def unmarked(text: str) -> str:
    """The text with what Markdown would read as marks taken literally."""
    return _MARKS.sub(r"\\\g<0>", text)


def _shown(texts: TableRow) -> TableRow:
    # The type of the text is kept, because Bold is a type.
    return tuple(text if text.isprintable() else type(text)(printable(text)) for text in texts)


def _styled(entry: str, heading: bool) -> Text:
    return Text(entry, style="italic" if heading else "bold" if isinstance(entry, Bold) else "")
