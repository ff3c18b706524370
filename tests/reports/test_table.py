"""One table, three looks."""

import html
import io
import re
from pathlib import Path

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


NOTES = tuple(f"Sentence {n} has some words that a reader may want to know." for n in range(9))


def lines_of(table, width=80, rest=None):
    console = Console(width=width, file=io.StringIO())
    console.print(table.rich(rest))
    return [line.rstrip() for line in console.file.getvalue().splitlines()]


@pytest.mark.parametrize(
    ("entry", "told"),
    [
        ("+3.0*", "*: reaches the gate stated in advance."),
        (Bold("+3.0* [1.0,4.0]"), "bold: the interval excludes zero; *: reaches the gate"),
        ("≤-1.0 [-2.0,0.0]", "≤, ≥, ~: a bound, since actors were missed."),
        ("~+0.0", "≤, ≥, ~: a bound"),
        ("[n.d., 3.0]", "n.d.: not detected."),
        ("+1.0 [0.5,2.0]°", "°: interval of events, not of scenes."),
        ("mine †", "†: knows the truth."),
        (Bold("flips"), ""),
        ("a*b", ""),
        ("+3.0 [1.0,4.0]", ""),
    ],
)
def test_the_marks_of_a_table_are_told_below_it_in_a_line(entry, told):
    rows = (("x", entry),)
    shown = lines_of(Table("t", ("a", "b"), rows))
    assert len(shown) == (4 if told else 3)
    assert told in shown[-1]
    # A column that stands in files alone needs no words, nor does a mark that a note tells.
    assert len(lines_of(Table("t", ("a", "b"), rows, files_only=("b",)))) == 3
    if told.startswith("†"):
        assert len(lines_of(Table("t", ("a", "b"), rows, ("† knows it.",)))) == 4


def test_notes_are_three_lines_that_end_with_the_place_of_the_rest():
    table = Table("t", ("a", "b"), (("x", "y"),), NOTES)
    *_, first, _, third = lines_of(table, rest=Path("runs/mine/tables.md"))
    assert first.startswith("Sentence 0")
    assert third.endswith("know. More: runs/mine/tables.md")
    assert len(lines_of(table, rest=Path("runs/mine/tables.md"))) == 3 + 3
    # One sentence longer than that is cut; short notes, and those that stand nowhere else, are not.
    long = Table("t", ("a", "b"), (("x", "y"),), ("word " * 90,))
    assert lines_of(long, rest=Path("tables.md"))[-1].endswith("word ... More: tables.md")
    assert (
        len(lines_of(Table("t", ("a", "b"), (("x", "y"),), NOTES[:2]), rest=Path("tables.md")))
        == 3 + 2
    )
    assert " ".join(NOTES) in " ".join(lines_of(table))


@pytest.mark.parametrize("length", range(60, 100, 3))
def test_a_folder_of_any_name_leaves_the_notes_three_lines(length):
    for notes in (NOTES, ("word " * 90,)):
        table = Table("t", ("a", "b"), (("x", "y"),), notes)
        lines = lines_of(table, rest=Path("f" * length, "tables.md"))
        assert len(lines) == 3 + 3
        assert max(map(len, lines)) <= 80
        assert "tables.md" in lines[-1]


def test_a_table_that_is_too_wide_goes_on_below_with_its_names_again():
    columns = ("policy", "budget", *(f"column {n}" for n in range(9)))
    rows = (
        ("One group of the rows",),
        ("care", "3%", *(f"+{n}.0 [{n}.0,{n}.5]" for n in range(9))),
    )
    shown = lines_of(Table("t", columns, rows, names=2))
    assert max(map(len, shown)) <= 80
    assert sum(line.startswith("policy budget") for line in shown) == 3
    assert sum(line.startswith("care   3%") for line in shown) == 3
    assert shown.count("One group of the rows") == 3
    text = "\n".join(shown)
    assert all(f"+{n}.0 [{n}.0,{n}.5]" in text for n in range(9))
    # A terminal that is wide enough has one part, as every table that fits.
    assert lines_of(Table("t", columns, rows, names=2), 200)[3].count("[") == 9


def test_a_part_leaves_out_rows_that_it_tells_nothing_of_and_keeps_pairs_together():
    columns = ("level", *(name for n in range(5) for name in (f"value {n}", "difference")))
    filled = tuple("0123456789" * 2 for _ in range(6))
    rows = (
        ("First",),
        ("a", *filled, "", "", "", ""),
        ("Last",),
        ("b", *([""] * 8), "some", "end"),
    )
    parts = "\n".join(lines_of(Table("t", columns, rows))).split("\n\n")
    assert [part.count("difference") for part in parts] == [1, 1, 2]
    assert [("First" in part, "Last" in part) for part in parts] == [
        (True, False),
        (True, False),
        (True, True),
    ]


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


def test_columns_in_which_nothing_stands_can_be_left_out():
    table = TABLE.without_empty_columns()
    assert table.columns == ("policy", "3%")
    assert table.rows == (("First, m",), ("x_y", "+5.0* [4.0,6.0]"), ("z†", "≤-1.0 [-2.0,0.0]"))
    assert isinstance(table.rows[1][1], Bold)
    assert (table.notes, table.quotes) == (TABLE.notes, TABLE.quotes)
    # Without a second column every row would read as a heading.
    nothing = Table("t", ("", "policy", "3%"), (("", "x", ""),), names=2).without_empty_columns()
    assert nothing.columns == ("", "policy")


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
