"""The examples of the documentation: a scenario and a source of another package."""

from tests.helpers.pages import fenced
from tests.helpers.places import ROOT


def example(page):
    """The one module that a page of `docs/write` holds."""
    (block,) = fenced(ROOT / "docs" / "write" / f"{page}.md", "python")
    return block
