"""Where the repository lies, or the sdist that holds these tests; its pages and examples."""

import re
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PUBLISHED = ROOT / "results" / "data"
"""The folders of published rows; in a clone alone."""
EXAMPLES = ROOT / "docs" / "examples"
README = ROOT / "README.md"
SITE = sorted(page for page in (ROOT / "docs").rglob("*.md") if not page.is_symlink())
RESULTS = sorted((ROOT / "results").glob("*.md"))
"""The pages of results that are written, not made: `tables.md` are in the folders."""
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


def example(page):
    """The one module that a page of `docs/write` holds."""
    (block,) = fenced(ROOT / "docs" / "write" / f"{page}.md", "python")
    return block


def loaded(file):
    """The module of a file that is in no package."""
    place = spec_from_file_location(file.stem, file)
    module = module_from_spec(place)
    place.loader.exec_module(module)
    return module
