"""One table, three looks."""

import html
import io
import re

import markdown_it
import pytest
from rich.console import Console

from care_sim.reports.latex import escaped, latex
from care_sim.reports.table import Bold, Table
from care_sim.reports.tables.crowding import crowding_tables
from care_sim.reports.tables.sweep import sweep_tables
from tests.helpers.made_rows import CROWD, STUDY

TABLE = Table(
    "a_b: 5% & more",
    ("policy", "3%", "extra"),
    (("First, m",), ("x_y", Bold("+5.0* [4.0,6.0]"), ""), ("z†", "≤-1.0 [-2.0,0.0]", "")),
    ("A note.",),
    ('Paper: "so".',),
)


def terminal(table, width=80):
    out = io.StringIO()
    Console(width=width, file=out, force_terminal=True, color_system="standard").print(table.rich())
    return out.getvalue()


def test_bold_is_bold_everywhere():
    assert "\x1b[1m+5.0* [4.0,6.0]" in terminal(TABLE)
    assert r"**+5.0\* [4.0,6.0]**" in TABLE.markdown()
    assert r"\textbf{+5.0* [4.0,6.0]}" in latex(TABLE)


def test_a_heading_spans_the_table():
    assert "| *First, m* |  |  |" in TABLE.markdown()
    assert r"\multicolumn{3}{l}{\emph{First, m}} \\" in latex(TABLE)
    assert "First, m" in terminal(TABLE)


def test_a_terminal_leaves_out_what_says_nothing():
    shown = terminal(TABLE)
    assert "extra" not in shown
    assert "so" not in shown
    assert "A note." in shown
    assert "3%" not in terminal(Table("t", ("a", "3%"), (("x", "y"),), files_only=("3%",)))


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("50%", r"50\%"),
        ("k_safe=0", r"k\_safe=0"),
        ("a & b", r"a \& b"),
        ("#1 $2 {3}", r"\#1 \$2 \{3\}"),
        ("a\\b", r"a\textbackslash{}b"),
        ("≤-5.0 [-6.0,4.0]", r"$\le$$-$5.0 [$-$6.0,4.0]"),
        ("~+1^2", r"$\sim$+1\textasciicircum{}2"),
        ("all-camera 3-5", "all-camera 3-5"),
        ('he said "so"', "he said ``so''"),
    ],
)
def test_latex_takes_every_sign_literally(text, written):
    assert escaped(text) == written


@pytest.mark.parametrize(
    "table", [TABLE, *sweep_tables(STUDY), *crowding_tables(CROWD)], ids=lambda t: t.title
)
def test_latex_is_well_formed(table):
    text = latex(table)
    opened, closed = (re.findall(rf"\\{word}{{(\w+)}}", text) for word in ("begin", "end"))
    assert sorted(opened) == sorted(closed) == ["adjustbox", "table", "tabular"]
    assert opened == closed[::-1]
    (columns,) = re.findall(r"\\begin{tabular}{(l+)}", text)
    body = text[text.index(r"\toprule") : text.index(r"\bottomrule")].splitlines()
    lines = [line for line in body if line.endswith(r"\\") and "multicolumn" not in line]
    assert {len(re.findall(r"(?<!\\)&", line)) + 1 for line in lines} == {len(columns)}
    assert len(lines) == 1 + sum(len(row) > 1 for row in table.rows)
    assert not re.search(r"(?<!\\)[%#_]", text)
    assert text.isascii()


HOSTILE = "p|q `r` [a](b) <b>x</b> _y_ &lt; *z* ~s~ \\ \n# t \x1b[31m \u202e"


def test_names_of_anybody_are_text_in_markdown_latex_and_on_a_terminal():
    table = Table(
        HOSTILE,
        ("a", HOSTILE),
        (("1", HOSTILE), ("2", Bold(HOSTILE)), (HOSTILE,)),
        (HOSTILE,),
        (HOSTILE,),
    )
    markdown = table.markdown()
    assert isinstance(table.rows[1][1], Bold)
    rendered = markdown_it.MarkdownIt("commonmark").enable("table").render(markdown)
    visible = HOSTILE.replace("\n", "\\n").replace("\x1b", "\\x1b").replace("\u202e", "\\u202e")
    assert rendered.count(html.escape(visible)) == 7
    assert rendered.count("<tr>") == 4
    assert not re.search(r"<(a|code|h1|s|del)\b", rendered)
    assert "\x1b" not in latex(table)
    for special in ("\\textbackslash{}", "\\_y\\_", "\\&lt;", "\\# t"):
        assert special in latex(table)
    console = Console(width=300, file=io.StringIO())
    console.print(table.rich())
    assert console.file.getvalue().count(visible) == 6
    assert "\x1b" not in console.file.getvalue()
