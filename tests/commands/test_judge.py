"""`care-sim judge` over a hand-built drive."""

import json

import pytest

from care_sim.cli import main


def run(*arguments):
    with pytest.raises(SystemExit) as end:
        main(["judge", *arguments])
    return end.value.code


def test_detectors_are_judged_told_and_not_replaced(drive, tmp_path, capsys):
    out = tmp_path / "out"
    options = ("--source", f"argoverse2:{drive}", "--workers", "1", "--out", str(out))
    detectors = ("--detectors", "returns", "cluster", "graded", "--least-scores", "0.2")
    assert run(*options, *detectors) == 0
    printed = capsys.readouterr().out
    assert f"Tables: {out / 'tables.md'}" in printed
    told = json.loads((out / "judge.json").read_text())
    assert told["source"] == "argoverse2"
    sums = told["detectors"]["returns"]["from score"]["0"]
    # What the proxy reports it has the true boxes of.
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
    assert run(*options, "--detectors", "returns", "--force", "--official") == 0
    truth, reported = (
        json.loads((out / "official" / f"{name}.json").read_text()) for name in ("truth", "returns")
    )
    assert [*truth] == [*reported]
    assert sum(map(len, reported.values())) == sums["boxes"]
    assert sum(map(len, truth.values())) == sums["frames"]


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--detectors", "nobody"], "unknown detector 'nobody'"),
        (["--detectors"], "--detectors needs at least one value"),
        (["--least-scores", "2"], "least_scores must be from 0 to 1, got 2"),
        (
            ["--detectors", "cluster", "--detector-parameters", "min_points=3"],
            "detector parameters are given as DETECTOR.NAME=VALUE of one of cluster, got "
            "min_points",
        ),
        (["--detectors", "cluster", "--scenes", "nowhere"], "nowhere"),
        (["--policy", "nobody", "--detectors", "cluster"], "unknown policy 'nobody'"),
        (["--detectors", "cluster", "--against", "nobody"], "unknown detector 'nobody'"),
    ],
)
def test_bad_options_are_refused_before_anything_is_played(
    arguments, complaint, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    assert run(*arguments) == 2
    error = capsys.readouterr().err
    assert complaint in error
    assert error.count("\n") == 1
    assert not (tmp_path / "runs").exists()
