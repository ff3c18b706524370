"""The workers of a machine's first study share the compiling."""

from functools import partial
from pathlib import Path

import pytest

from care_sim.base.compiled import compiled, lacks_code
from care_sim.batch.scanning import Scanning
from care_sim.batch.sight import Sight
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.journal import Journal
from care_sim.study.runner import compile_from_the_end, run_all


@compiled()
def doubled(number):
    return 2 * number


def test_a_function_lacks_code_until_it_is_called(tmp_path, monkeypatch):
    monkeypatch.setattr(doubled._cache._cache_file, "_index_path", str(tmp_path / "index.nbi"))
    monkeypatch.setattr(doubled._cache._cache_file, "_cache_path", str(tmp_path))
    assert lacks_code(doubled)
    assert doubled(2.5) == 5.0
    assert not lacks_code(doubled)


def test_a_damaged_index_is_no_reason_to_compile(tmp_path, monkeypatch):
    (tmp_path / "index.nbi").write_bytes(b"\x80")
    monkeypatch.setattr(doubled._cache._cache_file, "_index_path", str(tmp_path / "index.nbi"))
    assert not lacks_code(doubled)


def test_what_is_not_compiled_lacks_no_code():
    assert not lacks_code(doubled.py_func)


def test_the_keyframe_that_compiles_looks_last(monkeypatch):
    stages = []
    scan, look = Scanning.scan, Sight.look
    monkeypatch.setattr(Scanning, "scan", lambda *a: (stages.append("scan"), scan(*a))[1])
    monkeypatch.setattr(Sight, "look", lambda *a: (stages.append("look"), look(*a))[1])
    compile_from_the_end()
    assert stages == ["scan", "look"]


@pytest.mark.parametrize(("workers", "due"), [(2, True), (2, False), (1, True)])
def test_one_of_several_workers_compiles_where_it_is_due(workers, due, tmp_path, monkeypatch):
    monkeypatch.setattr("care_sim.study.runner.is_compiling_due", lambda: due)
    compiles = partial(Path.touch, tmp_path / "compiled")
    monkeypatch.setattr("care_sim.study.runner.compile_from_the_end", compiles)
    short = (("duration_s", 0.2),)
    configs = [
        EpisodeConfig("dartout", policy, scenario_parameters=short) for policy in ("care", "random")
    ]
    with Journal(tmp_path / "journal.jsonl", "sweep") as journal:
        assert run_all(configs, journal, workers) == []
    assert (tmp_path / "compiled").exists() == (workers > 1 and due)
