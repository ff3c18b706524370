"""A table of text, and how it looks on a terminal and in Markdown; `care_sim.study.latex` sets it in LaTeX."""

from dataclasses import dataclass

from rich.console import Group
from rich.table import Table as RichTable
from rich.text import Text

Row = tuple[str, ...]


class Bold(str):
    """Text to be set in bold."""

    __slots__ = ()


@dataclass(frozen=True)
class Table:
    """Entries of text under a title, with notes below.

    A row of one entry is a heading for the rows after it. A terminal shows no `quotes`, not the columns named in
    `files_only`, no empty columns, and nothing of a table without `terminal`; of the columns in `whole` it breaks
    only the headings.
    """

    title: str
    columns: Row
    rows: tuple[Row, ...]
    notes: tuple[str, ...] = ()
    quotes: tuple[str, ...] = ()
    files_only: tuple[str, ...] = ()
    whole: tuple[str, ...] = ()
    terminal: bool = True

    def rich(self) -> Group:
        """For a terminal of 80 characters."""
        table = RichTable(box=None, padding=(0, 1, 0, 0))
        shown = [n for n, name in enumerate(self.columns) if name not in self.files_only and self._is_used(n)]
        for n in shown:
            name = self.columns[n]
            heading = name.replace(" ", "\n") if name in self.whole else name
            table.add_column(Text(heading), no_wrap=name in self.whole, overflow="fold", vertical="bottom")
        for row in self.rows:
            entries = row if len(row) == 1 else [row[n] for n in shown]
            table.add_row(*(_styled(entry, heading=len(row) == 1) for entry in entries))
        return Group(Text(self.title, style="italic"), table, *(Text(note, style="dim") for note in self.notes))

    def markdown(self) -> str:
        """For a file."""
        lines = [self.columns, tuple("---" for _ in self.columns), *map(self._markdown_row, self.rows)]
        body = "\n".join("| " + " | ".join(line) + " |" for line in lines)
        return "\n\n".join([f"## {self.title}", body, *self.notes, *self.quotes]) + "\n"

    def _is_used(self, column: int) -> bool:
        return any(row[column] for row in self.rows if len(row) > 1)

    def _markdown_row(self, row: Row) -> Row:
        if len(row) == 1:
            return (f"*{row[0]}*", *("" for _ in self.columns[1:]))
        return tuple(f"**{entry}**" if isinstance(entry, Bold) else entry for entry in map(_unmarked, row))


def _unmarked(entry: str) -> str:
    """The entry with what Markdown would read as marks taken literally."""
    return type(entry)(entry.replace("*", r"\*").replace("|", r"\|").replace("~", r"\~"))


def _styled(entry: str, heading: bool) -> Text:
    return Text(entry, style="italic" if heading else "bold" if isinstance(entry, Bold) else "")
