"""Where the recorded data of development lies, if it does."""

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def recorded():
    """The folder with recorded drives; the test is skipped where it is absent."""
    root = Path(__file__).resolve().parents[2]
    for folder in (root / "shared" / "data", root.parent / "shared" / "data"):
        if folder.is_dir():
            return folder
    pytest.skip("no recorded drives in shared/data")
