"""`care-sim leaderboard`: which files make a table, and how a file is verified."""

import json
import re

import pytest

from care_sim.study.benchmark.bounds import BOUNDS
from care_sim.study.benchmark.budgets import REFERENCE_ENTRIES
from care_sim.study.benchmark.maker import made_by
from care_sim.study.benchmark.suite import Entry
from tests.helpers.commands import run
from tests.helpers.made_budgets import ALWAYS, HALF_WAY, NEVER, made_budgets

MINE = "mine:Mine"


def test_without_a_file_it_shows_the_published_entries(capsys, here):
    code, out, err = run(capsys, "leaderboard")
    assert (code, err) == (0, "")
    for entry in REFERENCE_ENTRIES:
        assert re.search(rf"^\d\S* +{re.escape(entry.name)} ", out, re.M)
    *_, last, end = re.findall(r"^ +(bound: .+?) +†", out, re.M)
    assert [last, end] == [bound.name for bound in BOUNDS]


def test_every_set_of_worlds_and_every_detector_has_its_table(capsys, here):
    for name, given in {
        "whole": {},
        "trial": {"quick": True, "streets": 24},
        "other": {"detector": "megvii"},
        "own": {"detector_parameters": (("worth", 2),)},
        # A detector's file has changed since.
        "changed": {"detector_parameters": (("worth", 2),), "made_by": {"detector_files": ["5"]}},
        "sealed": {"sealed": "5" * 64, "first": 0},
        "fresh": {"first": 2**31},
    }.items():
        made_budgets(MINE, HALF_WAY, **given).write(here / f"{name}.json")
    code, out, err = run(capsys, "leaderboard", ".")
    assert (code, err) == (0, "")
    titles = re.findall(r"^How few cells are enough: B90, (.*)", out, re.M)
    assert {*titles} == {
        "80 worlds (streets), centerpoint",
        "24 worlds (streets), centerpoint",
        "80 worlds (streets), megvii",
        "80 worlds (streets), centerpoint (worth=2)",
        "80 worlds sealed by 555555555555, centerpoint",
        "80 fresh worlds (streets), centerpoint",
    }
    # Published entries are of published streets, under detectors as they are shipped.
    page = (here / "runs" / "leaderboard" / "leaderboard.md").read_text()
    assert page.count("| care-sightlines |") == 3
    assert titles.count("80 worlds (streets), centerpoint (worth=2)") == 2
    assert page.count("A trial") == 1
    for n, title in enumerate(titles):
        figure = f"leaderboard-{n}.svg" if n else "leaderboard.svg"
        assert page.index(title) < page.index(f"]({figure})")
        assert (here / "runs" / "leaderboard" / figure).is_file()


def test_a_file_of_no_use_has_a_line_and_the_others_are_shown(capsys, here):
    made_budgets(MINE, HALF_WAY).write(here / "a.json")
    (here / "b.json").write_text("{")
    (here / "c.json").write_text(json.dumps({"care_sim_b90": 0}))
    (here / "d.json").write_text("{}")
    code, out, err = run(capsys, "leaderboard", ".", "e.json")
    assert (code, MINE in out) == (1, True)
    for line, start in zip(
        err.splitlines(),
        ("b.json cannot be read: ", "c.json is of version 0 of", "e.json cannot be read: No such"),
        strict=True,
    ):
        assert line.startswith(f"care-sim: left out: {start}")


def test_of_two_results_of_one_name_and_code_the_first_counts(capsys, here):
    made_budgets("boxes", HALF_WAY).write(here / "a.json")
    made_budgets("boxes", NEVER).write(here / "b.json")
    code, out, err = run(capsys, "leaderboard", ".")
    assert (code, "left out: b.json, since a.json has its name and its code" in err) == (1, True)
    # The published entry of the name stands beside it, by the hash of its code.
    assert re.findall(r"^\S+ +boxes #\w* +(\S+)", out, re.M)[:2] == ["2.4", "never"]


def test_two_of_one_name_and_different_code_are_two_entries(capsys, here):
    for code, curve in (("aaaaaaaaaaaa", HALF_WAY), ("bbbbbbbbbbbb", ALWAYS)):
        made_budgets(MINE, curve, made_by={"policy_code": code}).write(here / f"{code}.json")
    code, out, _ = run(capsys, "leaderboard", ".")
    assert code == 0
    assert re.findall(r"^\S+ +mine:Mine (#\w+) ", out, re.M)[:2] == ["#bbbbbbb", "#aaaaaaa"]


@pytest.fixture
def played(capsys, here, one_street):
    """A file that was played here, and its content."""
    words = "--policy", "history", "--quick", "--workers", 1
    assert run(capsys, "benchmark", *words)[0] == 0
    path = here / "runs" / "benchmark" / "history.centerpoint.quick.json"
    return path, json.loads(path.read_text())


def test_a_file_holds_as_its_policy_plays_and_other_counts_do_not(capsys, here, played):
    path, content = played
    (here / "a.json").write_text(json.dumps(content | {"policy": "absent:Mine"}))
    code, out, err = run(capsys, "leaderboard", "--verify", "a.json", path)
    assert (code, f"{path}: 1 world of 1, drawn by lot, agree" in out) == (1, True)
    assert "a.json cannot be verified: policy absent:Mine cannot be loaded" in err

    # By this code and machine every other count is false; by others one that moves a sum.
    def verified(move, maker):
        part, world, full, got = content["rows"][0]
        changed = [*got[:-1], [*got[-1][:2], got[-1][2] + move, got[-1][3]]]
        rows = [[part, world, full, changed]]
        path.write_text(json.dumps(content | {"rows": rows, "made_by": maker}))
        return run(capsys, "leaderboard", "--verify", path)

    here_made, abacus = made_by(Entry("history")), {"machine": {"processor": "Abacus\x1b[31m"}}
    full = content["rows"][0][2][2]
    code, _, err = verified(-1, here_made)
    assert (code, "1 of 1 worlds have other counts" in err) == (1, True)
    code, out, _ = verified(-1, abacus)
    assert (code, "differ in 1: sums move by up to 0." in out) == (0, True)
    assert ("by other code than here, on Abacus" in out, "\x1b" in out) == (True, False)
    code, _, err = verified(-0.1 * full, abacus)
    assert (code, "sums move by up to 10%" in err) == (1, True)
