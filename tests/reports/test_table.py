"""One table in Markdown, in LaTeX and on a terminal."""

import html
import io
import re
from pathlib import Path

import markdown_it
import pytest
from rich.console import Console

import care_sim.reports.page
from care_sim.reports.report import MOST_LINES, escaped, latex, shortened
from care_sim.reports.table import Bold, Table
from care_sim.reports.tables.crowding import crowding_tables
from care_sim.reports.tables.sweep import sweep_tables
from tests.helpers.made_rows import CROWD, STUDY

TABLE = Table(
    "a_b: 5% & more",
    ("policy", "3%", "extra"),
    (("First, m",), ("x_y", Bold("+5.0* [4.0,6.0]"), ""), ("z†", "≤-1.0 [-2.0,0.0]", "")),
    ("A note.", ""),
    ('Paper: "so".',),
)


def terminal(table, width=80, **options):
    console = Console(width=width, file=io.StringIO(), **options)
    console.print(table.rich())
    return console.file.getvalue()


@pytest.mark.parametrize(
    ("entry", "told"),
    [
        ("+3.0*", "*: reaches the gate."),
        (Bold("+3.0* [1.0,4.0]"), "Bold: the interval excludes 0; *: reaches the gate."),
        ("≤-1.0 [-2.0,0.0]", "≤, ≥, ~: a bound, since actors were missed."),
        ("[n.d., 3.0]", "n.d.: not detected."),
        ("+1.0 [0.5,2.0]°", "°: interval over events."),
        ("mine †", "†: knows the truth."),
        (Bold("flips"), None),
        ("a*b", None),
        ("+3.0 [1.0,4.0]", None),
    ],
)
def test_the_marks_of_a_table_are_explained_below_it_in_one_line(entry, told):
    table = Table("t", ("a", "b"), (("x", entry),), ("A note.",))
    assert table.lines == (("A note.", told) if told else ("A note.",))
    assert all(line in terminal(table) for line in table.lines)
    assert all(escaped(line) in latex(table) for line in table.lines)
    if told and told.startswith("†"):
        assert Table("t", ("a",), ((entry,), (entry,)), ("† knows it.",)).lines == ("† knows it.",)


def test_a_table_has_bold_type_headings_and_notes_in_all_three_forms():
    shown = terminal(TABLE, force_terminal=True, color_system="standard")
    assert "\x1b[1m+5.0* [4.0,6.0]" in shown
    assert r"**+5.0\* [4.0,6.0]**" in TABLE.markdown()
    assert r"\textbf{+5.0* [4.0,6.0]}" in latex(TABLE)
    assert "| *First, m* |  |  |" in TABLE.markdown()
    assert r"\multicolumn{3}{l}{\emph{First, m}} \\" in latex(TABLE)
    assert terminal(TABLE, 200).splitlines() == [
        "a_b: 5% & more",
        "policy 3%               ",
        "First, m",
        "x_y    +5.0* [4.0,6.0]  ",
        "z†     ≤-1.0 [-2.0,0.0] ",
        "A note.",
        TABLE.lines[1],
    ]
    assert all(
        'Paper: "so".' in text
        for text in (TABLE.markdown(), latex(TABLE).replace("``", '"').replace("''", '"'))
    )


def test_the_end_of_a_study_shows_the_first_rows():
    rows = (*((f"{n}", "x") for n in range(20)), ("Heading",), *(("y", "z") for _ in range(9)))
    table = Table("t", ("a", "b"), rows)
    console = Console(width=80, file=io.StringIO())
    short = shortened(table, console)
    assert len(console.render_lines(short.rich())) <= MOST_LINES
    assert short.rows == rows[: len(short.rows)]
    assert short.notes == (f"{len(short.rows)} of 30 rows; --verbose prints all.",)
    few = Table("t", ("a", "b"), rows[:3])
    assert shortened(few, console) is few


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("50%", r"50\%"),
        ("k_safe=0", r"k\_safe=0"),
        ("#1 $2 {3} & 4", r"\#1 \$2 \{3\} \& 4"),
        ("a\\b", r"a\textbackslash{}b"),
        ("≤-5.0 [-6.0,4.0]", r"$\le$$-$5.0 [$-$6.0,4.0]"),
        ("~+1^2", r"$\sim$+1\textasciicircum{}2"),
        ("all-camera 3-5", "all-camera 3-5"),
        ('he said "so"', "he said ``so''"),
    ],
)
def test_latex_takes_every_sign_literally(text, written):
    assert escaped(text) == written


@pytest.mark.parametrize("table", [TABLE, *sweep_tables(STUDY)[:2], *crowding_tables(CROWD)[-1:]])
def test_latex_is_well_formed(table):
    text = latex(table)
    opened, closed = (re.findall(rf"\\{word}{{(\w+)}}", text) for word in ("begin", "end"))
    assert sorted(opened) == sorted(closed) == ["adjustbox", "table", "tabular"]
    (columns,) = re.findall(r"\\begin{tabular}{(l+)}", text)
    body = text[text.index(r"\toprule") : text.index(r"\bottomrule")].splitlines()
    lines = [line for line in body if line.endswith(r"\\") and "multicolumn" not in line]
    assert {len(re.findall(r"(?<!\\)&", line)) + 1 for line in lines} == {len(columns)}
    assert len(lines) == 1 + sum(len(row) > 1 for row in table.rows)
    assert not re.search(r"(?<!\\)[%#_]", text)
    assert text.isascii()


HOSTILE = "p|q `r` [a](b) <b>x</b> _y_ &lt; *z* ~s~ \\ \n# t \x1b[31m \u202e"


def test_names_of_anybody_are_text_in_markdown_latex_and_on_a_terminal():
    rows = (("1", HOSTILE), ("2", Bold(HOSTILE)), (HOSTILE,))
    table = Table(HOSTILE, ("a", HOSTILE), rows, (HOSTILE,), (HOSTILE,))
    rendered = markdown_it.MarkdownIt("commonmark").enable("table").render(table.markdown())
    visible = HOSTILE.replace("\n", "\\n").replace("\x1b", "\\x1b").replace("\u202e", "\\u202e")
    assert rendered.count(html.escape(visible)) == 7
    assert rendered.count("<tr>") == 4
    assert not re.search(r"<(a|code|h1|s|del)\b", rendered)
    assert "\x1b" not in latex(table)
    for special in ("\\textbackslash{}", "\\_y\\_", "\\&lt;", "\\# t"):
        assert special in latex(table)
    shown = terminal(table, 300)
    assert shown.count(visible) == 6
    assert "\x1b" not in shown


def test_how_to_read_the_tables_is_one_page_of_at_most_500_words_for_site_and_report():
    """Every mark that a table may have is on it."""
    page = Path(__file__).parents[2] / "docs/reading.md"
    asset = Path(care_sim.reports.page.__file__).parent / "assets/reading.md"
    assert asset.read_text() == page.read_text()
    assert len(re.findall(r"\w[\w'.-]*", page.read_text())) <= 500
    assert all(f"`{mark}`" in page.read_text() for mark in "*°≤≥~†‡§")


def test_a_table_that_is_too_wide_goes_on_below_itself_and_breaks_no_number():
    columns = ("test", *(f"policy-{n}" for n in range(9)))
    row = ("in all", *(f"103/96/{n}37 1.03" for n in range(9)))
    terminal = io.StringIO()
    Console(width=80, file=terminal).print(Table("wide", columns, (row,)).rich())
    lines = terminal.getvalue().splitlines()
    assert all(len(line) <= 80 for line in lines)
    assert all(sum(entry in line for line in lines) == 1 for entry in row[1:])
    assert sum(line.startswith("in all") for line in lines) == 3
