"""The first command on nuScenes of the page "Your detector", where the devkit is not installed."""

import re

import pytest

pytest.importorskip("torch")
pytest.importorskip("yaml")
from tests.helpers.detector_page import commands, typed, write_belongings


def test_the_page_judges_an_adapter(tmp_path):
    write_belongings(tmp_path, 1)
    judge, *_ = commands("Four commands on nuScenes")
    assert re.search(r"OpenPCDet +0\.3 +100\.0 +100\.0 +100\.0 ", typed(judge, tmp_path))
