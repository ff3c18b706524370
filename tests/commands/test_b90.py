"""`care-sim benchmark --score b90`: from a policy of one's own to a line in the table."""

import pytest

from care_sim.evaluation.smallest_budget import BUDGETS
from care_sim.study.benchmark import budgets
from care_sim.study.benchmark.budgets import read_budget_result
from care_sim.study.benchmark.suite import STREETS, TESTS
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
    assert "B90, 1 world, centerpoint" in out
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
    assert (code, "B90, 2 worlds, returns" in out) == (0, True)
    # Published entries play streets alone.
    assert "care-sector" not in out
    path = here / "runs" / "benchmark" / "boxes.b90.returns.quick.closed-loop.json"
    street, test = read_budget_result(path).rows
    assert (street.part, test.part, test.full) == (STREETS, TESTS, (1.0, 0.0))
    assert {len(counts) for counts in test.got} == {2}
    assert len(read_budget_result(path).counts) == 2


@pytest.mark.parametrize(
    ("words", "told"),
    [
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
