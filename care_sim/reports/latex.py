"""Tables in LaTeX, with booktabs: a file to be read in by another."""

import re

from care_sim.reports.table import Bold, Table, TableRow

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
