"""`care-sim benchmark --score b90`: from a policy of one's own to a line in the table."""

import pytest

from care_sim.evaluation.smallest_budget import BUDGETS
from care_sim.study.benchmark import budgets
from care_sim.study.benchmark.budgets import read_budget_result
from care_sim.study.benchmark.recorded import AHEAD
from care_sim.study.benchmark.suite import STREETS, TESTS
from tests.helpers import kitti_drive
from tests.helpers.commands import run
from tests.helpers.made_budgets import HALF_WAY, made_budgets

MINE = """
from care_sim.policies.own.boxes import Boxes

class Mine(Boxes):
    name = "mine"
"""


@pytest.fixture
def one_street(monkeypatch, tmp_path):
    """A trial of one street, with one published entry."""
    monkeypatch.setattr(budgets, "QUICK_STREETS", 1)
    monkeypatch.setattr(budgets, "_REFERENCES", tmp_path / "references.json")
    budgets.publish_references([made_budgets("care-sector", HALF_WAY, streets=1)])


def test_a_policy_of_ones_own_gets_a_line(capsys, here, one_street):
    (here / "mine.py").write_text(MINE)
    words = "benchmark", "--score", "b90", "--policy", "mine:Mine", "--quick", "--workers", 1
    code, out, err = run(capsys, *words)
    assert (code, "8 plays took" in err) == (0, True)
    assert "B90, 1 world (streets), centerpoint" in out
    assert "mine:Mine" in out
    assert "care-sector" in out
    folder = here / "runs" / "benchmark"
    path = folder / "mine-Mine.b90.centerpoint.quick.json"
    assert f"Result: {path.relative_to(here)}" in out
    assert (folder / "b90.centerpoint.quick.svg").is_file()
    result = read_budget_result(path)
    assert result.worlds == ((STREETS, 200),)
    (row,) = result.rows
    assert len(row.got) == len(BUDGETS)
    # Chances of newcomers are fractions, and object frames are whole.
    assert row.full[1] % 1
    assert row.full[2] % 1 == 0
    assert row.got[0][2] < row.got[-1][2] <= row.full[2] * 1.05

    # The same command finds all of it, and the file is the same.
    before = path.read_text()
    code, _, err = run(capsys, *words)
    assert (code, path.read_text(), "took" in err) == (0, before, False)

    # It is no result of the other score.
    code, _, err = run(capsys, "leaderboard", folder)
    assert (code, "no result of care-sim benchmark" in err) == (2, True)


def test_drives_and_tests_count_collisions_and_needless_stops(
    capsys, here, one_street, monkeypatch
):
    monkeypatch.setattr(budgets, "EPISODES_PLAYED", {TESTS: 1})
    words = "--quick", "--closed-loop", "--workers", 1, "--detector", "returns"
    code, out, _ = run(capsys, "benchmark", "--score", "b90", "--policy", "boxes", *words)
    assert (code, "B90, 2 worlds (streets 1, tests 1), returns" in out) == (0, True)
    # Published entries play streets alone.
    assert "care-sector" not in out
    path = here / "runs" / "benchmark" / "boxes.b90.returns.quick.closed-loop.json"
    street, test = read_budget_result(path).rows
    assert (street.part, test.part, test.full) == (STREETS, TESTS, (1.0, 0.0))
    assert {len(counts) for counts in test.got} == {2}
    assert len(read_budget_result(path).counts) == 2


def test_recorded_drives_are_a_part_of_their_own(capsys, here, monkeypatch, tmp_path):
    monkeypatch.setattr(budgets, "_REFERENCES", tmp_path / "references.json")
    drives = ["kitti/0000", "kitti/0004"]
    published = made_budgets("care-sector", HALF_WAY, streets=1, recorded=drives)
    budgets.publish_references([published])
    for drive in ("0000", "0004"):
        kitti_drive.write(here / "DATA", drive)
    words = "--recorded", "kitti:DATA", "--without-streets", "--workers", 1
    code, out, err = run(capsys, "benchmark", "--score", "b90", "--policy", "boxes", *words)
    assert (code, "16 plays took" in err) == (0, True)
    assert "B90, 2 worlds (recorded ahead), centerpoint" in out
    assert "B90 on recorded drives by source" in out
    # Fewer than five drives.
    assert "carry no interval" in out
    assert "[" not in out.partition("B90, 2 worlds")[2].partition("\n\n")[0]
    assert "care-sector" in out
    path = here / "runs/benchmark/boxes.b90.centerpoint.recorded.without-streets.json"
    result = read_budget_result(path)
    assert result.worlds == tuple((AHEAD, drive) for drive in drives)
    assert "DATA" not in path.read_text()
    row = result.rows[0]
    # One person comes into view; two cars and a cyclist stand there from the first keyframe on.
    assert row.full[0] > 0.5
    assert row.full[2] > row.full[3] > 0
    assert row.got[-1][2] <= row.full[2] * 1.1


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--recorded", "boreas"], "recorded is for --score b90"),
        (["--score", "b90", "--without-streets"], "give recorded too"),
        (["--score", "b90", "--recorded", "streets"], "source must be"),
        (["--score", "b90", "--recorded", "kitti:absent"], "absent is no folder"),
        (["--detector", "megvii"], "detector is for --score b90"),
        (["--closed-loop"], "closed_loop is for --score b90"),
        (["--score", "b91"], "score"),
        (["--score", "b90", "--sealed", "salt.txt"], "plays no sealed set yet"),
        (["--score", "b90", "--detector", "absent"], "detector"),
    ],
)
def test_what_does_not_fit_is_refused(capsys, here, words, told):
    code, out, err = run(capsys, "benchmark", "--policy", "care", *words)
    assert (code, out) == (2, "")
    assert told in err


def test_a_policy_that_knows_the_truth_takes_no_part(capsys, here):
    code, _, err = run(capsys, "benchmark", "--score", "b90", "--policy", "history-oracle")
    assert (code, "knows the truth" in err) == (2, True)
