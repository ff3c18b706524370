"""A command refuses bad input in one line, before anything is played."""

import re
import shlex

import pytest

from tests.helpers.commands import run

LINES = r"""
walk                                      | unknown command 'walk'
polices                                   | unknown command 'polices'; perhaps `list policies`; known:
merge one                                 | merge needs two folders at least: care-sim report FOLDER FOLDER
bench --seconds 3                         | `care-sim bench` is `make bench` now
run                                       | missing: SCENARIO|SOURCE|AGENT
run dens                                  | unknown scenario 'dens'; the nearest is dense; known:
run no/body                               | unknown agent 'no/body'; known: learned-scorer,
run ppo --policy care                     | --policy has no meaning for an agent
run dense --policy kare                   | unknown policy 'kare'; the nearest is care; known: after-ancha,
run dense --bugdet 1                      | unrecognized options: --bugdet 1; perhaps --budget
run dense --budget x                      | --budget takes {None}|FLOAT:
run dense --budget 1.5                    | budget must lie in (0, 1], got 1.5
run dense --seed abc                      | --seed takes INT: invalid literal for int() with base 10: 'abc'
run dense --false-negative-rate 1.1       | false_negative_rate must lie in [0, 1]
run dense --scenario-parameters wheels    | NAME=VALUE, got 'wheels'
run dense --scenario-parameters a=3 a=4   | once
run dense --scenario-parameters ego_speed_mps=(1e300,1e300) | ego_speed_mps of dense
run dense --video ''                      | an argument is empty
run dartout --record NOWHERE/file/x.rrd   | file
run dartout --picture x.gif               | unknown ending of a picture '.gif'; known: .png
run dartout --scene x                     | --scene has no meaning in the closed loop
run street --seed 400                     | seed must be of a scene of streets, 0 to 149, got 400
run street --scenario-parameters x=1      | --scenario-parameters has no meaning in the open loop
run argoverse2:nowhere                    | source argoverse2:nowhere: nowhere is no folder
sweep --policy care                       | perhaps --policies
sweep --seeds 1001                        | seeds must be one number, a count from 1 to 1,000
sweep --seeds 999 1000 10000              | got 999 of test and 1000 of calibration and 10000 of train
sweep --budgets                           | --budgets needs at least one value
sweep --false-negative-rate 0.3 --false-negative-rates 0.1 | give false_negative_rate one value or several, not both
study faults --camera-latency 1           | camera_latency is a fault that grows
study ncap --step-kph 33 --tests CPNCO-50 | no speed of these tests is a multiple of 33 km/h
study validate cutin --seeds 1000 1001    | 1,000
study validate cutin --factors mirrored=half | mirrored of cutin 'half'
study order --scenes 4                    | --scenes has no meaning without --source
study firing --sensor os1-64              | --sensor has no meaning without --source
study realism --seeds 990 991             | got 990 of test and 1090 of calibration
study realism --tables dense              | unknown table 'dense'; the nearest is dense-5; known:
study mechanism --scenes 1 --driver full  | driver must be a policy with a budget, got 'full'
study mechanism --scenes 1 --driver care-sbf --policy-parameters care-sbf.k_safe=0 | the driver care-sbf plays without parameters, got k_safe
study mechanism --scenes 1 --policy-parameters ppo.path=w.npz | policy parameter ppo.path is of a policy that is not played; played are history, all-camera, care
protocol --source waymo:.                 | unknown source 'waymo:.'; known: streets, argoverse2:FOLDER,
protocol --version v1.0-mini              | version has no meaning for streets
protocol --scenes 151                     | scenes must be a number from 1 to 150 or names, got 151
protocol --camera-latency 1 --camera-latencies 0 1 | give camera_latency one value or several
report                                    | report needs the folder of a study, its --out
report NOWHERE                            | no results at
report a b --page x.html                  | --page and --minus take one folder
report a -o x --source streets --episodes 0 | --source has no meaning without --page and --episodes
report a --minus care -o x.html           | --minus has no meaning with --page
benchmark --policy care --cell-order best | cell_order
benchmark --policy care --quick --fresh 2 | remove quick and sealed
benchmark --policy care --fresh 2 --closed-loop | fresh and sealed worlds are streets alone
benchmark --policy care --without-streets | give recorded too
benchmark --policy care --recorded streets | source must be
benchmark --policy care --recorded kitti:absent | absent is no folder
benchmark --policy care --sealed x        | give --out a folder that only you read
benchmark --policy care --detector absent | detector
benchmark --policy care --sealed none.txt --out s | none.txt holds no salt
benchmark --policy care place --name Ours | names one entry
benchmark --policy care --name 'a|b'      | without | <
leaderboard --verify                      | name the results to verify
leaderboard .                             | no result of care-sim benchmark in .
leaderboard . --sealed x                  | give verify too
leaderboard . --recorded boreas           | give verify too
judge --detectors cluster --against nobody | unknown detector 'nobody'
judge --least-scores 2                    | least_scores must be from 0 to 1, got 2
judge --detectors cluster --detector-parameters min_points=3 | DETECTOR.NAME=VALUE of one of cluster, got min_points
export nuscenes --source argoverse2:x --out y | source must be nuscenes:FOLDER
view TABLE                                | is no recording of `care-sim run --record`
certify --episode 3 --all                 | episode plays one episode: leave --all out
train learned-sets --out NOWHERE          | is a folder, a file is wanted
"""  # noqa: E501
CASES = [line.split(" | ", 1) for line in LINES.strip("\n").splitlines()]


@pytest.mark.parametrize(("line", "told"), CASES, ids=[" ".join(line.split()) for line, _ in CASES])
def test_one_line_and_exit_code_2(line, told, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    table = tmp_path / "table.png"
    table.write_bytes(b"PAR1 and rows")
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty" / "file").touch()
    words = shlex.split(line.replace("TABLE", str(table)).replace("NOWHERE", "empty"))
    code, out, err = run(capsys, *words)
    complaints = [one for one in err.splitlines() if "left out: policy" not in one]
    assert (code, out, len(complaints)) == (2, "", 1), err
    assert complaints[0].startswith("care-sim: ")
    assert told in complaints[0]
    assert re.fullmatch(r"[ -~]+", complaints[0])
    assert len(complaints[0]) < 2100
    assert {path.name for path in tmp_path.iterdir()} == {"table.png", "empty"}
    assert table.read_bytes() == b"PAR1 and rows"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["run", "\ud800"], "no text"),
        (["run", "a\0b"], "no text"),
        (["run", "dense", "--policy", "\udcff\x1b[31m"], r"\udcff\x1b[31m"),
        (["run", "dense", "--export", "a" * 300], "path must be a path"),
        (["run", "dense", "--policy-parameters", "a=" + "-" * 5000 + "1"], "unknown parameter"),
        (["protocol", "--scenes", "9" * 5000], "scenes"),
    ],
)
def test_what_no_shell_gives_is_one_printable_line_too(words, told, capsys):
    code, out, err = run(capsys, *words)
    assert (code, out) == (2, "")
    assert told in err
    assert err.rstrip("\n").isprintable()
    assert len(err) < 2100
