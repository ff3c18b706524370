"""The paper is cited alike wherever it is cited."""

import pytest

from tests.helpers.places import ROOT

yaml = pytest.importorskip("yaml")


def test_the_paper_has_the_same_authors_wherever_it_is_cited():
    paper = yaml.safe_load((ROOT / "CITATION.cff").read_text())["preferred-citation"]
    names = [f"{one['family-names']}, {one['given-names']}" for one in paper["authors"]]
    assert f"author    = {{{' and '.join(names)}}}" in (ROOT / "docs" / "cite.md").read_text()
