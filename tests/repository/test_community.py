"""Texts for other places name what this repository holds."""

import pytest
from pyarrow.parquet import read_metadata

from tests.helpers.places import PUBLISHED, ROOT

yaml = pytest.importorskip("yaml")
COMMUNITY = ROOT / "docs" / "community"


def front_matter(name):
    """The data that Hugging Face reads of a card."""
    _, head, text = (COMMUNITY / name).read_text().split("---\n", 2)
    assert text.startswith("\n# ")
    return yaml.safe_load(head)


def test_the_dataset_card_has_a_configuration_for_every_file_of_rows():
    card = front_matter("dataset-card.md")
    named = [config["data_files"] for config in card["configs"]]
    files = sorted(PUBLISHED.rglob("*.parquet"))
    assert named == [file.relative_to(PUBLISHED).as_posix() for file in files]
    assert len({config["config_name"] for config in card["configs"]}) == len(named)
    assert sum("default" in config for config in card["configs"]) == 1
    rows = sum(read_metadata(file).num_rows for file in files)
    assert card["size_categories"] == "1M<n<10M"
    assert 1_000_000 < rows < 10_000_000


def test_the_paper_has_the_same_authors_wherever_it_is_cited():
    paper = yaml.safe_load((ROOT / "CITATION.cff").read_text())["preferred-citation"]
    names = [f"{one['family-names']}, {one['given-names']}" for one in paper["authors"]]
    for page in (ROOT / "docs" / "cite.md", COMMUNITY / "dataset-card.md"):
        assert f"author    = {{{' and '.join(names)}}}" in page.read_text()
