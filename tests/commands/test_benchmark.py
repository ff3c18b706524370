"""`care-sim benchmark`: from a policy of one's own to a line in the table."""

import re
import shlex
import sys

import pytest

from care_sim.base.seeds import FRESH
from care_sim.evaluation.smallest_budget import BUDGETS
from care_sim.study.benchmark import budgets
from care_sim.study.benchmark import result as result_files
from care_sim.study.benchmark.recorded import AHEAD
from care_sim.study.benchmark.result import read_result
from care_sim.study.benchmark.suite import STREETS, TESTS, Salt
from tests.helpers import kitti_drive
from tests.helpers.commands import run
from tests.helpers.made_budgets import HALF_WAY, made_budgets
from tests.helpers.places import ROOT, fenced

PAGE = (ROOT / "docs" / "benchmark.md").read_text()
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", PAGE, re.S | re.M)
POLICY, *_ = fenced(ROOT / "docs" / "write" / "policy.md", "python")
TRANSCRIPT = [
    shlex.split(line)[1:]
    for _, text in BLOCKS
    if "corridor:Corridor --quick" in text
    for line in text.splitlines()
    if line.startswith("care-sim ")
]
THIRD_PARTY = """
import gc, gymnasium, care_sim

class Throwing(care_sim.Policy):
    def demand(self, belief):
        raise RuntimeError("no idea")

class Spy(care_sim.Policy):
    def demand(self, belief):
        if any(isinstance(each, gymnasium.Env) for each in gc.get_objects()):
            raise RuntimeError("here is the environment")
        return care_sim.Demand()

class Oracle(care_sim.PrivilegedPolicy):
    def demand(self, belief):
        return care_sim.Demand()
"""


def test_a_policy_of_ones_own_gets_a_line(capsys, here, one_street):
    """The page's own policy and commands, with one street."""
    (here / "corridor.py").write_text(POLICY)
    quick, whole, table, verify = TRANSCRIPT
    code, out, err = run(capsys, *quick)
    assert (code, "8 plays took" in err) == (0, True)
    assert "B90, 1 world (streets), centerpoint" in out
    # One street has no interval, so that nobody has a rank.
    assert {*re.findall(r"^\S+", out, re.M)} >= {"corridor:Corridor", "care-sector"}
    folder = here / "runs" / "benchmark"
    path = folder / "corridor-Corridor.centerpoint.quick.json"
    assert f"Result: {path.relative_to(here)}" in out
    assert (folder / "b90.centerpoint.quick.svg").is_file()
    result = read_result(path)
    assert result.worlds == ((STREETS, 200),)
    (row,) = result.rows
    assert len(row.got) == len(BUDGETS)
    # Chances of newcomers are fractions, and object frames are whole.
    assert row.full[1] % 1
    assert row.full[2] % 1 == 0
    assert row.got[0][2] < row.got[-1][2] <= row.full[2] * 1.05
    # A median decision takes no longer than a slow one, and neither takes no time.
    median, slow = result.policy_ms
    assert 0.1 < median <= slow < 10_000
    assert f"{median:.1f} / {slow:.1f}" in out

    # The same command finds all of it, and the file is the same.
    before = path.read_text()
    code, _, err = run(capsys, *quick)
    assert (code, path.read_text(), "took" in err) == (0, before, False)

    # The whole is played next, and both have their table beside the published entry.
    assert run(capsys, *whole)[0] == 0
    code, out, err = run(capsys, *table)
    assert (code, err) == (0, "")
    assert out.count("How few cells are enough") == 1
    assert (here / "runs" / "leaderboard" / "leaderboard.svg").is_file()
    code, out, _ = run(capsys, *verify)
    assert (code, "1 world of 1, drawn by lot, agree" in out) == (0, True)


def test_drives_and_tests_count_collisions_and_needless_stops(
    capsys, here, one_street, monkeypatch
):
    monkeypatch.setattr(budgets, "EPISODES_PLAYED", {TESTS: 1})
    words = "--quick", "--closed-loop", "--workers", 1, "--detector", "returns"
    code, out, _ = run(capsys, "benchmark", "--policy", "boxes", *words)
    assert (code, "B90, 2 worlds (streets 1, tests 1), returns" in out) == (0, True)
    # No published entry has played these tests beside streets.
    assert "care-sector" not in out
    result = read_result(here / "runs" / "benchmark" / "boxes.returns.quick.closed-loop.json")
    street, test = result.rows
    assert (street.part, test.part, test.full) == (STREETS, TESTS, (1.0, 0.0))
    assert {len(counts) for counts in test.got} == {2}
    assert len(result.counts) == 2


def test_a_detector_has_parameters_in_the_result_and_no_published_entry_beside_it(
    capsys, here, one_street
):
    (here / "recall.csv").write_text("returns,recall\n400,1\n")
    words = "benchmark", "--policy", "boxes", "--quick", "--workers", 1, "--detector", "graded"
    given = "--detector-parameters", "file=recall.csv"
    code, out, _ = run(capsys, *words, *given)
    assert (code, "B90, 1 world (streets), graded (file=recall.csv)" in out) == (0, True)
    path = here / "runs/benchmark/boxes.graded-file=recall.csv.quick.json"
    few = read_result(path)
    assert few.detector_parameters == (("file", "recall.csv"),)
    code, out, _ = run(capsys, "leaderboard", "--verify", path)
    assert (code, "1 world of 1, drawn by lot, agree" in out) == (0, True)

    # Another content of the file plays again.
    (here / "recall.csv").write_text("returns,recall\n1,1\n")
    assert run(capsys, *words, *given)[0] == 0
    many = read_result(path)
    assert many.rows[0].full[2] > 2 * few.rows[0].full[2] > 0
    code, _, err = run(capsys, *words, "--detector-parameters", "file=none.csv")
    assert (code, "none.csv: no CSV table" in err) == (2, True)


def test_recorded_drives_are_a_part_of_their_own(capsys, here, monkeypatch, tmp_path):
    monkeypatch.setattr(result_files, "_REFERENCES", tmp_path / "references")
    drives = ["kitti/0000", "kitti/0004"]
    published = made_budgets("care-sector", HALF_WAY, recorded=drives)
    result_files.publish_references([published])
    for drive in ("0000", "0004"):
        kitti_drive.write(here / "DATA", drive)
    words = "--recorded", "kitti:DATA", "--without-streets", "--workers", 1
    code, out, err = run(capsys, "benchmark", "--policy", "boxes", *words)
    assert (code, "16 plays took" in err) == (0, True)
    assert "B90, 2 worlds (recorded ahead), centerpoint" in out
    assert "B90 on recorded drives by source" in out
    # Fewer than five drives.
    assert "carry no interval" in out
    assert "[" not in out.partition("B90, 2 worlds")[2].partition("\n\n")[0]
    assert "care-sector" in out
    path = here / "runs/benchmark/boxes.centerpoint.recorded-kitti.without-streets.json"
    result = read_result(path)
    assert result.worlds == tuple((AHEAD, drive) for drive in drives)
    assert "DATA" not in path.read_text()
    row = result.rows[0]
    # To verify the file its drives are needed.
    code, _, err = run(capsys, "leaderboard", "--verify", path)
    assert (code, "it plays kitti/0000: give --recorded" in err) == (1, True)
    code, out, _ = run(capsys, "leaderboard", "--verify", path, "--recorded", "kitti:DATA")
    assert (code, "2 worlds of 2, drawn by lot, agree" in out) == (0, True)
    # One person comes into view; two cars and a cyclist stand there from the first keyframe on.
    assert row.full[0] > 0.5
    assert row.full[2] > row.full[3] > 0
    assert row.got[-1][2] <= row.full[2] * 1.1


def test_others_cannot_reach_the_environment_and_one_that_throws_is_named(capsys, here, one_street):
    (here / "others.py").write_text(THIRD_PARTY)
    names = ("others:Spy", "others:Throwing", "others:Oracle")
    words = "--quick", "--workers", 1
    code, out, err = run(capsys, "benchmark", "--policy", *names, *words)
    assert (code, "others" in sys.modules) == (1, False)
    assert "Result: runs/benchmark/others-Spy.centerpoint.quick.json" in out
    assert "left out: policy others:Oracle knows the truth, and the benchmark plays none" in err
    assert "RuntimeError: no idea (others.py, line 6)" in err
    assert "Throwing" not in out


def test_fresh_streets_are_drawn_once_per_folder(capsys, here, one_street):
    words = "benchmark", "--fresh", 1, "--workers", 1, "--policy"
    assert run(capsys, *words, "history")[0] == 0
    code, out, _ = run(capsys, *words, "boxes")
    assert (code, "1 fresh world" in out) == (0, True)
    one, other = (
        read_result(here / "runs" / "benchmark" / f"{name}.centerpoint.fresh-1.json")
        for name in ("history", "boxes")
    )
    assert one.worlds == other.worlds
    assert one.worlds[0][1] in FRESH
    code, out, _ = run(capsys, "leaderboard", "runs/benchmark")
    assert (code, out.count("How few cells")) == (0, 1)


def test_a_sealed_set_is_played_and_verified_by_its_salt_alone(capsys, here, one_street):
    (here / "salt.txt").write_text("0123456789abcdef" * 4)
    (here / "other.txt").write_text("fedcba9876543210" * 4)
    sealed = "--sealed", "salt.txt"
    played = run(capsys, "benchmark", "--policy", "history", *sealed, "--out", "sealed")
    assert played[0] == 0
    salt = Salt.read(here / "salt.txt")
    path = here / "sealed" / f"history.centerpoint.sealed-{salt.digest[:8]}.json"
    assert read_result(path).sealed == salt.digest
    assert read_result(path).worlds == ((STREETS, 0),)
    assert str(salt.seed(STREETS, 0)) not in path.read_text()
    assert f"sealed by {salt.digest[:12]}" in " ".join(played[1].split())
    assert "care-sector" not in played[1]
    assert run(capsys, "leaderboard", "--verify", "sealed", *sealed)[0] == 0
    for words in ([], ["--sealed", "other.txt"]):
        code, _, err = run(capsys, "leaderboard", "--verify", "sealed", *words)
        assert (code, "sealed by the salt" in err) == (1, True)


@pytest.mark.parametrize("policy", ["absent:Mine", "math:pi", "history-oracle"])
def test_a_policy_that_cannot_take_part_is_left_out_and_then_none_is_left(capsys, here, policy):
    code, out, err = run(capsys, "benchmark", "--policy", policy)
    assert (code, out) == (2, "")
    assert err.endswith("care-sim: none of the policies can be played\n")
