"""Files that are there whole or not at all."""

import contextlib

import pytest

from care_sim.errors import InvalidInput
from care_sim.files import replacing


def test_the_old_file_stays_until_the_new_one_is_whole(tmp_path):
    file = tmp_path / "deeper" / "table.csv"
    for text in ("old", "new"):
        with replacing(file) as unfinished:
            assert unfinished.suffix == ".csv"
            unfinished.write_text(text)
            assert not file.exists() or file.read_text() == "old"
    assert file.read_text() == "new"
    with contextlib.suppress(RuntimeError), replacing(file) as unfinished:
        unfinished.write_text("half")
        raise RuntimeError
    assert file.read_text() == "new"
    assert list(file.parent.iterdir()) == [file]


def test_a_file_has_one_writer_at_a_time(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with replacing(tmp_path / "table.csv") as unfinished:
        with pytest.raises(InvalidInput, match=r"table\.csv is being written already"):
            replacing(unfinished.with_name("table.csv").relative_to(tmp_path)).__enter__()
        unfinished.write_text("whole")
    assert (tmp_path / "table.csv").read_text() == "whole"


def test_a_folder_is_refused(tmp_path):
    with pytest.raises(InvalidInput, match="is a folder"), replacing(tmp_path):
        pass
