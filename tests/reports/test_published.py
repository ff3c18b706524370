"""Published rows give the published numbers, whatever the words around them are."""

import re
from collections import Counter
from dataclasses import replace
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from care_sim.reports.report import TABLES, StudyReport, next_steps, print_report, read_results

RESULTS = Path(__file__).parents[2] / "results"
FOLDERS = ("crowding", "faults", "ncap", "r157", "validate-drive-factors", "vehicle")


def numbers(markdown):
    """How often every entry with a number stands under a column and heading, in a row of a name."""
    found = Counter()
    columns = heading = ""
    for line in markdown.splitlines():
        if not line.startswith("| "):
            columns = ""
        elif not line.startswith("| ---"):
            first, *rest = (entry.strip() for entry in line.strip("|").split("|"))
            columns = columns or rest
            heading = heading if any(rest) else first
            entries = zip(columns, rest, strict=True)
            found.update((heading, first, *each) for each in entries if re.search(r"\d", each[1]))
    return found


@pytest.mark.parametrize("name", FOLDERS)
def test_every_number_of_a_published_table_is_made_again(name):
    rows, study, left_out = read_results(RESULTS / name)
    plain = replace(study, figures=lambda _rows: {})
    made = numbers(StudyReport.of(rows, plain, left_out).texts[TABLES])
    published = numbers((RESULTS / name / TABLES).read_text())
    assert sum(published.values()) > 100
    assert published - made == Counter()


@pytest.mark.parametrize("name", [*FOLDERS, "closed-loop-5", "streets-cluster"])
def test_a_study_ends_with_at_most_25_lines_of_which_three_are_commands(name):
    rows, study, left_out = read_results(RESULTS / name)
    console = Console(width=80, file=StringIO())
    print_report(rows, console, study, left_out)
    lines = console.file.getvalue().splitlines() + next_steps(RESULTS / name, study, rows)
    assert len(lines) <= 25
    assert sum(line.startswith("  care-sim ") for line in lines) == 3


def test_the_papers_study_ends_with_medians_ties_and_the_statements_that_hold():
    rows, study, left_out = read_results(RESULTS / "closed-loop-5")
    console = Console(width=80, file=StringIO())
    print_report(rows, console, study, left_out)
    title, columns, first, *_ = console.file.getvalue().splitlines()
    assert (title, columns.split()) == (
        "First detection: median, m",
        ["scenario", "budget", "history", "all-camera", "care", "best", "control", "full"],
    )
    assert first.split() == ["dense", "3%", "4.3", "7.8", "16.2", "16.2", "fan", "16.2"]
    told = " ".join(console.file.getvalue().split())
    assert "ties the best policy in 8 of 8 comparisons (first detection, m)" in told
    assert "The paper: 10 of 12 statements hold. Not: dart-out 10%: history brakes" in told
