"""The pages of the results: every folder has its line in the index and its place on the page of a
question, which begins with the answer.
"""

import re
import shlex

import pytest

from care_sim import cli
from tests.helpers.pages import RESULTS, links
from tests.helpers.places import ROOT

FOLDER = ROOT / "results"
INDEX = FOLDER / "README.md"
QUESTIONS = [page for page in RESULTS if page.name not in ("README.md", "findings.md")]
PUBLISHED = sorted(
    entry.name
    for entry in FOLDER.iterdir()
    if entry.is_dir() or entry.suffix in (".json", ".png", ".gif")
)
LINES = re.findall(r"^\| \[.*", INDEX.read_text(), re.M)
"""Those of the index's tables, one for what one command left."""


def published(text):
    """What of the folder a text links to."""
    targets = re.findall(r"\]\(([^)#]+)", text)
    return {target.split("/")[0] for target in targets} & set(PUBLISHED)


@pytest.mark.parametrize("name", PUBLISHED)
def test_what_is_published_stands_on_one_line_of_the_index(name):
    assert len([line for line in LINES if name in published(line)]) == 1


@pytest.mark.parametrize("name", [name for name in PUBLISHED if (FOLDER / name).is_dir()])
def test_a_folder_has_its_place_on_the_page_of_a_question(name):
    assert any(name in published(page.read_text()) for page in QUESTIONS)


def test_the_commands_of_the_index_are_understood():
    told = [re.findall(r"`(care-sim [^`]*)`", line) for line in LINES]
    assert all(told)
    for command in (command for line in told for command in line):
        numbered = re.sub(r"\$\(seq (\d+) (\d+)\)", listed, re.sub(r"\bN\b", "0", command))
        cli.parsed_command(shlex.split(numbered)[1:])


def listed(sequence):
    """The numbers that the shell puts in the place of `$(seq FIRST LAST)`."""
    first, last = map(int, sequence.groups())
    return " ".join(map(str, range(first, last + 1)))


@pytest.mark.parametrize("page", QUESTIONS, ids=lambda page: page.stem)
def test_a_page_asks_answers_and_says_what_does_not_hold(page):
    question, answer, *_ = page.read_text().split("\n\n")
    assert re.fullmatch(r"# .*\?", question)
    assert answer.startswith("**")
    assert "\n## What does not hold\n" in page.read_text()


@pytest.mark.parametrize("page", QUESTIONS, ids=lambda page: page.stem)
def test_the_index_and_the_site_lead_to_every_page(page):
    assert page.name in links(INDEX)
    assert f": results/{page.name}\n" in (ROOT / ".mkdocs.yml").read_text()
