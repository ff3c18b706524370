"""`care-sim study mechanism` over a hand-built drive."""

import pytest

from care_sim.cli import main
from care_sim.study.results_formats import MECHANISM
from care_sim.study.rows.parquet import read_rows


def run(*arguments):
    with pytest.raises(SystemExit) as end:
        main(["study", "mechanism", *arguments])
    return end.value.code


def test_the_command_plays_prints_resumes_and_is_reported_again(drive, tmp_path, capsys):
    out = tmp_path / "out"
    options = ("--source", f"argoverse2:{drive}", "--policies", "history", "--workers", "1")
    assert run(*options, "--budget", "0.05", "--out", str(out)) == 0
    printed = capsys.readouterr().out
    assert "on the belief of care" in printed
    assert "Scenes: 1, with 1 first sighting; plays: 3." in printed
    rows = read_rows(out / MECHANISM.file, MECHANISM.schema)
    assert [row["policy"] for row in rows] == ["care", "history", "full"]
    assert all(len(row["misses"]) == 1 for row in rows)

    assert run(*options, "--budget", "0.05", "--out", str(out)) == 0
    assert "3 of 3 accounted plays found" in capsys.readouterr().err
    with pytest.raises(SystemExit) as end:
        main(["report", str(out)])
    assert end.value.code == 0
    assert capsys.readouterr().out in printed


def test_another_driver_does_not_replace_what_is_there(drive, tmp_path, capsys):
    out = str(tmp_path / "out")
    policies = ("--policies", "care", "all-camera")
    options = ("--source", f"argoverse2:{drive}", "--workers", "1", *policies)
    assert run(*options, "--out", out) == 0
    assert run(*options, "--out", out, "--driver", "all-camera") == 2
    assert "(driver care, now all-camera), would be gone" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--driver", "full"], "driver must be a policy with a budget, got 'full'"),
        (["--driver", "nobody"], "unknown policy 'nobody'"),
        (["--policies", "nobody"], "unknown policy 'nobody'"),
        (["--budget", "0"], "budget must lie in (0, 1], got 0.0"),
        (["--presence", "seen"], "presence must be 'annotated' or 'visible', got 'seen'"),
        (
            ["--driver", "care-sbf", "--policy-parameters", "care-sbf.k_safe=0"],
            "the driver care-sbf plays without parameters, got k_safe: give those of another",
        ),
        (
            ["--policy-parameters", "ppo.path=w.npz"],
            "policy parameter ppo.path is of a policy that is not played; played are history, "
            "all-camera, care",
        ),
        (["--scenes", "-1"], "scenes must be a number from 1 to 150 or names, got -1"),
    ],
)
def test_what_the_command_does_not_take_is_one_line(arguments, complaint, capsys, tmp_path):
    assert run("--scenes", "1", "--out", str(tmp_path / "out"), *arguments) == 2
    error = capsys.readouterr().err
    assert complaint in error
    assert error.count("\n") == 1
