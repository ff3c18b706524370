"""Where the recorded data of development lies, if it does."""

import pytest

from tests.helpers.places import ROOT


@pytest.fixture(scope="session")
def recorded():
    """The folder with recorded drives; the test is skipped where it is absent."""
    for folder in (ROOT / "shared" / "data", ROOT.parent / "shared" / "data"):
        if folder.is_dir():
            return folder
    pytest.skip("no recorded drives in shared/data")
