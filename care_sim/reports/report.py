"""A study from configurations to a folder of results, and a report of what lies in one."""

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from care_sim.base.errors import InvalidInput, counted, printable, unknown
from care_sim.base.files import json_content, write_text
from care_sim.reports.studies import STUDIES, SWEEP, study_of
from care_sim.reports.study import Study
from care_sim.reports.table import Bold, Table, TableRow, unmarked
from care_sim.study.journal import UNFINISHED, describe_progress
from care_sim.study.results_formats import results_format_in
from care_sim.study.rows.checks import RowChecks
from care_sim.study.rows.parquet import read_notes, read_rows, read_table
from care_sim.study.rows.reading import policy_of
from care_sim.study.run_config import FULL, Row

PREAMBLE = "% \\usepackage{booktabs,adjustbox}\n"
_FIT = "max width=\\textwidth,max totalheight=0.85\\textheight"
"""A table that is too wide or too long for a page is scaled down."""

_SPECIAL = {
    **{sign: f"\\{sign}" for sign in "&%$#_{}"},
    "\\": r"\textbackslash{}",
    "~": r"$\sim$",
    "^": r"\textasciicircum{}",
    "≤": r"$\le$",
    "≥": r"$\ge$",
    "†": r"\textdagger{}",
    "‡": r"\textdaggerdbl{}",
    "§": r"\S{}",
    "°": r"\textdegree{}",
    "±": r"$\pm$",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
}
_ESCAPES = str.maketrans(_SPECIAL)
_MINUS = re.compile(r"(?<!\w)-(?=\d)")


def escaped(text: str) -> str:
    """Text as LaTeX prints it; a hyphen before a number is a minus, but not one within a word."""
    # Quotation marks after the escapes, which know none of the signs that they become.
    quoted = re.sub(r'"([^"]*)"', r"``\1''", text.translate(_ESCAPES))
    return _MINUS.sub("$-$", quoted)


def paragraph(text: str) -> str:
    """A paragraph in small print."""
    return f"{{\\footnotesize {escaped(text)}\\par}}\n"


def latex(table: Table) -> str:
    """The table as a float with a caption; its notes and quotes stand in the caption."""
    caption = " ".join([f"{table.title}.", *table.lines, *table.quotes])
    columns = len(table.columns)
    lines = [
        "\\begin{table}[tbp]",
        "\\centering\\footnotesize",
        f"\\caption{{{escaped(caption)}}}",
        f"\\begin{{adjustbox}}{{{_FIT}}}",
        f"\\begin{{tabular}}{{{'l' * columns}}}",
        "\\toprule",
        _line(table.columns),
        "\\midrule",
        *(_heading(row[0], columns) if len(row) == 1 else _line(row) for row in table.rows),
        "\\bottomrule",
        "\\end{tabular}",
        "\\end{adjustbox}",
        "\\end{table}",
    ]
    return "\n".join(lines) + "\n"


def _line(row: TableRow) -> str:
    return " & ".join(map(_entry, row)) + r" \\"


def _entry(text: str) -> str:
    return f"\\textbf{{{escaped(text)}}}" if isinstance(text, Bold) else escaped(text)


def _heading(text: str, columns: int) -> str:
    return f"\\multicolumn{{{columns}}}{{l}}{{\\emph{{{escaped(text)}}}}} \\\\"


if TYPE_CHECKING:
    from matplotlib.figure import Figure

TABLES = "tables.md"
"""Name of the file in a folder of results that holds all tables."""
CONFIG = "config.json"
_READING = "How to read the tables: `docs/reading.md`.\n"
PAGE = "report.html"
"""Name of a page where none is given."""
MOST_LINES = 15
"""Lines of a table at the end of a study."""


def read_results(folder: Path) -> tuple[list[Row], Study, list[str]]:
    """The rows in a folder of results, each once, their study, and what is missing of it.

    Raises InvalidInput where there are no rows of a study, and where two rows of one task differ.
    """
    kind = results_format_in(folder)
    # Rows are written when a study ends. A journal without them is of a study that was stopped.
    if not (folder / kind.file).is_file() and (told := describe_progress(folder)):
        raise InvalidInput(told)
    path = folder / kind.file
    study = study_of(path)
    # A study of plays among episodes, or the other way round, is a file with a wrong name.
    if study.results is not kind:
        raise InvalidInput(
            f"{path} holds no rows of the study {study.name}, which are in {study.results.file}"
        )
    checks = RowChecks()
    rows = [row for row in read_rows(path, study.schema) if checks.is_new(row, folder)]
    twice = [f"{counted(checks.twice, 'row')} written twice"] if checks.twice else []
    unknown = checks.unknown(read_table(path).column_names, study.schema)
    return rows, study, [*dict.fromkeys([*read_notes(path)[1], *twice, *unknown])]


def described(folder: Path) -> dict[str, Any]:
    """Return the description of the folder in `config.json`; nothing if it cannot be read."""
    try:
        content = json_content(folder / CONFIG)
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


@dataclass(frozen=True)
class StudyReport:
    """Report of a study: the texts of its files of tables by name, and its figures."""

    texts: Mapping[str, str]
    figures: Mapping[str, "Figure"]

    @classmethod
    def of(
        cls, rows: Sequence[Row], study: Study = SWEEP, left_out: Sequence[str] = ()
    ) -> "StudyReport":
        """The report of a study that lacks what is `left_out`."""
        # Imported here and below because it loads Matplotlib, before anything is printed.
        from care_sim.reports.figures.styles import default_style

        tables = study.tables(rows)
        with default_style():
            figures = study.figures(rows)
        closing = _closing(rows, study, left_out)
        pages = [_READING, *(table.markdown() for table in tables)]
        if closing:
            sentences = "".join(f"- {unmarked(sentence)}\n" for sentence in closing)
            pages.append(f"## Statements\n\n{sentences}")
        texts = [PREAMBLE, *map(latex, tables), *map(paragraph, closing)]
        return cls({TABLES: "\n".join(pages), "tables.tex": "\n".join(texts)}, figures)

    def write(self, folder: Path) -> None:
        """Write tables and figures into a folder; then figures of an earlier study are removed."""
        from care_sim.reports.figures.styles import remove_others, save

        # New files first, then what is no longer of this study: whoever stops it in between keeps
        # both.
        for name, text in self.texts.items():
            write_text(folder / name, text)
        for name, figure in self.figures.items():
            save(figure, folder / name)
        remove_others(
            folder,
            (name for known in STUDIES.values() for name in known.figures_of()),
            self.figures,
        )


def print_report(
    rows: Sequence[Row],
    console: Console,
    study: Study = SWEEP,
    left_out: Sequence[str] = (),
    *,
    verbose: bool = False,
) -> None:
    """Print the headline of a study and its closing sentences; all tables where it is `verbose`."""
    if verbose:
        tables = study.tables(rows)
    else:
        headline = study.headline(rows) if study.headline else None
        # Full scans alone have no levels by budget.
        first = [headline] if headline and headline.rows else study.tables(rows)[:1]
        tables = [shortened(table, console) for table in first]
    for table in tables:
        console.print(table.rich())
        console.print()
    for sentence in _closing(rows, study, left_out):
        console.print(sentence, markup=False)


def shortened(table: Table, console: Console) -> Table:
    """The first rows of a table, as many as a console shows in `MOST_LINES`."""
    shown = table
    kept = len(table.rows)
    while kept > 1 and len(console.render_lines(shown.rich(), pad=False)) > MOST_LINES:
        kept -= 1
        # A heading alone says nothing.
        while len(table.rows[kept - 1]) == 1 and kept > 1:
            kept -= 1
        note = f"{kept} of {len(table.rows)} rows; --verbose prints all."
        shown = replace(table, rows=table.rows[:kept], notes=(note,))
    return shown


def print_minus(rows: Sequence[Row], console: Console, study: Study, policy: str) -> None:
    """Print one policy, named as in the tables, less each of the others. Raises InvalidInput for a
    policy that the rows do not have, or that is alone in them, and for a study without such tables.
    """
    if study.minus is None:
        able = ", ".join(each.name for each in STUDIES.values() if each.minus)
        raise InvalidInput(
            f"the study {study.name} has no tables of one policy minus each; those that have: "
            f"{able}"
        )
    if policy not in (known := {policy_of(row) for row in rows}):
        raise unknown("policy in these results", policy, known)
    if policy == FULL:
        raise InvalidInput(
            f"{FULL} has a budget of its own, at which there is no other: give the policy that it "
            "is to be compared with"
        )
    tables = study.minus(rows, policy)
    if not tables:
        raise InvalidInput(f"there is nothing that {policy} can be compared with in these results")
    for table in tables:
        console.print(table.rich())
        console.print()


def next_steps(folder: Path, study: Study, rows: Sequence[Row] = ()) -> list[str]:
    """The lines that end a study: where its results are, and three commands to go on with."""
    names = study.figures_of(rows)
    figures = {path.name for name in names for path in folder.glob(f"{name}.png")}
    beside = f" and {counted(len(figures), 'figure')}" if figures else ""
    report = shlex.join(["care-sim", "report", str(folder)])
    return [
        *(
            [f"Not all of it: {describe_progress(folder)}"]
            if (folder / UNFINISHED).is_file()
            else []
        ),
        f"Results are in {folder}: {TABLES}{beside}",
        "Next:",
        f"  {report} --verbose",
        f"  {report} -o {shlex.quote(str(folder / PAGE))}",
        f"  {report} --minus POLICY" if study.minus else "  care-sim run dense --policy care",
    ]


def _closing(rows: Sequence[Row], study: Study, left_out: Sequence[str]) -> list[str]:
    return [*map(printable, [*study.closing(rows), *(f"Left out: {what}." for what in left_out)])]
