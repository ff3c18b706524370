"""JSON of the user's, as deep and as large as it may be: one line, wherever it is read."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from care_sim.base import files
from care_sim.base.errors import InvalidInput
from care_sim.base.files import (
    MOST_BYTES,
    listed_values,
)
from care_sim.policies.learned.weights import load_weights
from care_sim.reports.page.build import CONFIG, description_in
from care_sim.sources.nuscenes.table_files import LARGEST_TABLE, read_json
from care_sim.study.journal import LARGEST_JOURNAL, Journal
from care_sim.training.folder import read_config

DEEP = "[" * 100_000 + "]" * 100_000


def test_every_reader_says_in_one_line_that_a_file_is_too_deep(tmp_path):
    table = tmp_path / "scene.json"
    table.write_text(DEEP)
    with pytest.raises(InvalidInput, match=r"scene\.json: no readable JSON file .*deep"):
        read_json(table)
    weights = tmp_path / "weights.npz"
    np.savez(weights, card=np.frombuffer(DEEP.encode(), np.uint8))
    with pytest.raises(InvalidInput, match=r"weights\.npz: no \.npz of weights .*deep"):
        load_weights(weights)
    (tmp_path / CONFIG).write_text(DEEP)
    description, (trouble,) = description_in(tmp_path)
    assert description == {}
    assert "deep" in trouble


def zeros(path, size):
    """So many bytes that take no space, or without a size a pipe."""
    path.unlink(missing_ok=True)
    if size is None:
        os.mkfifo(path)
    else:
        path.touch()
        os.truncate(path, size)


@pytest.mark.parametrize(
    ("more", "reason"),
    [(1, r"it holds \d+ bytes and may hold \d+"), (None, "it is not a regular file")],
)
def test_every_reader_refuses_what_is_too_large_before_it_is_read(
    tmp_path, monkeypatch, more, reason
):
    monkeypatch.setattr(Path, "read_text", lambda *_, **__: pytest.fail("it is read"))
    path = tmp_path / CONFIG
    zeros(path, more and LARGEST_TABLE + more)
    with pytest.raises(InvalidInput, match=rf"config\.json: no readable JSON file \({reason}"):
        read_json(path)
    zeros(path, more and LARGEST_JOURNAL + more)
    with pytest.raises(InvalidInput, match=rf"config\.json is no journal: {reason}"):
        Journal(path)
    zeros(path, more and MOST_BYTES + more)
    with pytest.raises(InvalidInput, match=rf"config\.json is damaged: {reason}"):
        read_config(path)
    description, (trouble,) = description_in(path.parent)
    assert description == {}
    assert "cannot be read (it " in trouble


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=6,
)


@pytest.fixture
def narrow(monkeypatch):
    """A reader that sees few characters at a time."""
    monkeypatch.setattr(files, "_CHUNK", 400)
    monkeypatch.setattr(files, "MOST_CHARACTERS", 400)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(VALUES, max_size=30), st.sampled_from([None, 0, 2]), st.booleans())
def test_a_list_is_read_value_by_value_as_it_is_read_whole(tmp_path, narrow, values, indent, plain):
    path = tmp_path / "a.json"
    path.write_text(json.dumps(values, indent=indent, ensure_ascii=plain) + "\n", encoding="utf-8")
    assert [*listed_values(path)] == values


WRONG = {
    "": "no list",
    "{}": "no list",
    "[": "Expecting value",
    "[1": "neither a comma nor the end",
    "[1,": "value 2 is no JSON .*Expecting value",
    "[1,]": "value 2 is no JSON .*Expecting value",
    "[1 2]": "neither a comma nor the end",
    "[1]]": "text after the end",
    "[] 1": "text after the end",
    '[{"a": 1': "delimiter",
    f"[{DEEP}]": "deep",
}


@pytest.mark.parametrize("text", WRONG, ids=range(len(WRONG)))
def test_what_is_no_list_is_a_value_error(tmp_path, text):
    path = tmp_path / "a.json"
    path.write_text(text)
    with pytest.raises(ValueError, match=WRONG[text]):
        [*listed_values(path)]


def test_values_come_before_the_end_of_the_file_is_read(tmp_path, narrow):
    path = tmp_path / "a.json"
    path.write_text("[" + "1," * 10_000 + "!")
    assert next(listed_values(path)) == 1
