"""A folder of one's own with results of the benchmark."""

import pytest

from tests.helpers.made_results import made_result


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def library(here):
    """What the repository's own policies reached."""
    folder = here / "results" / "data" / "leaderboard"
    for policy, share in (("place", 0.5), ("care", 0.7)):
        made_result(policy, share).write(folder / f"{policy}.json")
    return folder
