"""The pages of the documentation, and what they hold."""

import re

from tests.helpers.places import ROOT

README = ROOT / "README.md"
SITE = sorted(page for page in (ROOT / "docs").rglob("*.md") if not page.is_symlink())
RESULTS = sorted((ROOT / "results").glob("*.md"))
"""Those of the results that are written, not made: `tables.md` lie in the folders."""
SHIPPED = sorted((ROOT / "care_sim").glob("*/*/shipped/README.md"))
PAGES = [README, ROOT / "CONTRIBUTING.md", *SHIPPED, *RESULTS, *SITE]


def fenced(page, language):
    """The blocks of a page that are marked with a language, or with none."""
    blocks = re.findall(r"^```(\w*)\n(.*?)^```$", page.read_text(), re.S | re.M)
    return [text for marked, text in blocks if marked == language]


def links(page):
    """The files to which a page links, as it names them."""
    return re.findall(r"\]\((?!http|#)([^)#\s]+)", page.read_text())


def name_of(page):
    return str(page.relative_to(ROOT))
