"""JSON of the user's, as deep as it may be: one line, wherever it is read."""

import json

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.base.json_text import MOST_LEVELS, parsed
from care_sim.policies.learned.weights import load
from care_sim.reports.page.provenance import CONFIG, _description
from care_sim.sources.nuscenes.tables import read_json

DEEP = {n: "[" * n + "]" * n for n in (MOST_LEVELS, MOST_LEVELS + 1, 980, 100_000)}


def test_what_is_not_too_deep_comes_back():
    for text in ('{"a": [1, {"b": null}]}', DEEP[MOST_LEVELS], "3", '"\\ud800"'):
        assert parsed(text) == json.loads(text)
    assert parsed('{"a": {"b": 1}}', len) == 1
    wide = json.dumps([[[n]] for n in range(1000)])
    assert parsed(wide) == json.loads(wide)


@pytest.mark.parametrize(
    "text", [DEEP[MOST_LEVELS + 1], DEEP[980], DEEP[100_000], "[" * 100_000, '{"a":' * 100_000]
)
def test_what_is_too_deep_is_a_value_error(text):
    with pytest.raises(ValueError, match="deep"):
        parsed(text)


@pytest.mark.parametrize("levels", [980, 100_000])
def test_every_reader_says_so_in_one_line(tmp_path, levels):
    table = tmp_path / "scene.json"
    table.write_text(DEEP[levels])
    with pytest.raises(InvalidInput, match=r"scene\.json: no readable JSON file .*deep"):
        read_json(table)
    weights = tmp_path / "weights.npz"
    np.savez(weights, card=np.frombuffer(DEEP[levels].encode(), np.uint8))
    with pytest.raises(InvalidInput, match=r"weights\.npz: no \.npz of weights .*deep"):
        load(weights)
    (tmp_path / CONFIG).write_text(DEEP[levels])
    description, (trouble,) = _description(tmp_path / CONFIG)
    assert description == {}
    assert "deep" in trouble
