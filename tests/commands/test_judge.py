"""`care-sim judge` over a hand-built drive."""

import json
from concurrent.futures import ThreadPoolExecutor

import pytest

from care_sim.cli import main


def run(*arguments):
    with pytest.raises(SystemExit) as end:
        main(["judge", *arguments])
    return end.value.code


def test_detectors_are_judged_told_and_not_replaced(drive, tmp_path, capsys):
    out = tmp_path / "out"
    played = ("--source", f"argoverse2:{drive}", "--workers", "1", "--out", str(out))
    options = (*played, "--lidar-dropout", "0.1")
    detectors = ("--detectors", "returns", "cluster", "graded", "returns", "--least-scores", "0.2")
    assert run(*options, *detectors) == 0
    printed = capsys.readouterr().out
    assert f"Tables: {out / 'tables.md'}" in printed
    told = json.loads((out / "judge.json").read_text())
    assert told["conditions"]["source"] == "argoverse2"
    assert told["conditions"]["lidar_dropout"] == 0.1
    sums = told["detectors"]["returns"]["from score"]["0"]
    # The proxy reports true boxes.
    assert sums["right"] == sums["boxes"] == sums["found"] > 0
    assert told["detectors"]["cluster"]["from score"]["0.2"]["boxes"] > 0
    assert told["detectors"]["cluster"]["scan_ms"] > 0
    assert {path.name for path in out.iterdir()} == {
        "judge.json", "tables.md", "detectors.png", "detectors.svg"
    }  # fmt: skip
    tables = (out / "tables.md").read_text()
    assert "## Detectors" in tables
    assert "## By class" in tables

    assert run(*options, *detectors) == 2
    assert "holds what was judged before" in capsys.readouterr().err
    (out / "official").mkdir()
    (out / "official" / "of-before.json").write_text("{}")
    assert run(*options, "--detectors", "returns", "--force", "--official") == 0
    assert not (out / "official" / "of-before.json").exists()
    truth, reported = (
        json.loads((out / "official" / f"{name}.json").read_text()) for name in ("truth", "returns")
    )
    assert [*truth] == [*reported]
    assert sum(map(len, reported.values())) == sums["boxes"]
    assert sum(map(len, truth.values())) == sums["frames"]


class Fails:
    """A detector that no scan suits."""

    def detect(self, points, sensor_height_m):
        raise RuntimeError("too bright")


def test_a_detector_that_fails_is_named_and_ends_with_1(drive, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("care_sim.commands.judge.processes", ThreadPoolExecutor)
    options = ("--source", f"argoverse2:{drive}", "--workers", "1", "--out", str(tmp_path / "out"))
    assert run(*options, "--detectors", "returns", f"{__name__}:Fails") == 1
    error = capsys.readouterr().err
    assert "failed: drive: " in error
    assert "RuntimeError: too bright" in error
