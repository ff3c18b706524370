"""`care-sim benchmark` and `care-sim leaderboard`: from a policy of one's own to a line."""

import json
import re
import shlex
import sys
from dataclasses import replace
from random import Random

import pytest

from care_sim.study.benchmark import suite
from care_sim.study.benchmark.result import read_result
from care_sim.study.benchmark.suite import PARTS, Entry, published_worlds
from tests.helpers.commands import run
from tests.helpers.places import ROOT

PAGE = (ROOT / "docs" / "benchmark.md").read_text()
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", PAGE, re.S | re.M)
(POLICY,) = [text for language, text in BLOCKS if language == "python"]
TRANSCRIPT = [
    line
    for _, text in BLOCKS
    if "python corridor.py" in text
    for line in text.splitlines()
    if line.startswith("care-sim ")
]
LOT = next(
    n for n in range(99) if (r := Random(n)).sample(range(3), 1) == r.sample(range(3), 1) == [1]
)
"""Rows of the trial are one a part with each camera: drive, test, street."""
THROWING = """
import care_sim

class Throwing(care_sim.Policy):
    def demand(self, belief):
        raise RuntimeError("no idea")
"""

SPY = """
import gc, gymnasium, care_sim

class Spy(care_sim.Policy):
    def demand(self, belief):
        if any(isinstance(each, gymnasium.Env) for each in gc.get_objects()):
            raise RuntimeError("here is the environment")
        return care_sim.Demand()

class Oracle(care_sim.PrivilegedPolicy):
    def demand(self, belief):
        return care_sim.Demand()
"""


@pytest.fixture
def one_of_each(monkeypatch, tmp_path):
    """A suite as small as it can be: one drive, one test, one street; so is its tenth."""
    first = {part: next(w for w in published_worlds() if w.part == part) for part in PARTS}
    text = json.dumps({part: [[w.seed, w.reachable]] for part, w in first.items()})
    (tmp_path / "worlds.json").write_text(text)
    monkeypatch.setattr(suite, "_PUBLISHED", tmp_path / "worlds.json")
    published_worlds.cache_clear()
    yield
    published_worlds.cache_clear()


@pytest.fixture
def lot_of_a_test(monkeypatch):
    """Both lots fall on the test, which takes less time than a street or a drive."""
    monkeypatch.setattr("care_sim.commands.leaderboard.SystemRandom", lambda: Random(LOT))


def test_a_newcomer_gets_a_line(capsys, here, one_of_each, library, lot_of_a_test):
    """The page's own policy and commands; trial and whole are cut to one world a part."""
    (here / "corridor.py").write_text(POLICY)
    benchmark, leaderboard, whole, table = TRANSCRIPT
    code, out, _ = run(capsys, *shlex.split(benchmark)[1:])
    assert code == 0
    assert re.search(r"^1 +corridor:Corridor +\d", out, re.M)
    assert "Result: runs/benchmark/corridor-Corridor.quick.json" in out
    code, out, _ = run(capsys, *shlex.split(leaderboard)[1:])
    assert code == 0
    assert {*re.findall(r"^\d +(\S+)", out, re.M)} == {"corridor:Corridor", "care", "place"}
    assert "A trial with the tenth of the worlds" in out
    trial = here / "runs" / "leaderboard-quick"
    assert "corridor:Corridor" in (trial / "leaderboard.md").read_text()

    # The same command finds all of it, and the file is the same.
    file = here / "runs" / "benchmark" / "corridor-Corridor.quick.json"
    before = file.read_text()
    code, _, err = run(capsys, *shlex.split(benchmark)[1:])
    assert (code, file.read_text(), "took" in err) == (0, before, False)

    # A trial is no line of the leaderboard.
    code, out, err = run(capsys, "leaderboard", library, "runs/benchmark")
    assert code == 1
    assert "Corridor" not in out
    assert "corridor-Corridor.quick.json is of --quick" in err

    # The whole is one, and its table leaves that of the trial where it is.
    before = (trial / "leaderboard.md").read_text()
    assert run(capsys, *shlex.split(whole)[1:])[0] == 0
    _, out, _ = run(capsys, *shlex.split(table)[1:])
    assert {*re.findall(r"^\d +(\S+)", out, re.M)} == {"corridor:Corridor", "care", "place"}
    assert (trial / "leaderboard.md").read_text() == before

    # Verified it holds; with every row made up it does not.
    code, out, _ = run(capsys, "leaderboard", "--verify", file)
    assert (code, "2 episodes of 6, drawn by lot, came out again as the file says" in out) == (
        0,
        True,
    )
    result = read_result(file)
    # The others are verified, whatever one is.
    replace(result, tags=("learned",)).write(here / "a.json")
    replace(result, entry=Entry("absent:Mine")).write(here / "b.json")
    code, out, err = run(capsys, "leaderboard", "--verify", "a.json", "b.json", file)
    assert (code, f"{file.name}: 2 episodes" in out) == (1, True)
    assert "a.json: it says that the policy is learned, and it is causal" in err
    assert "b.json cannot be verified: policy absent:Mine cannot be loaded" in err
    otherwise = replace(result, rows=tuple(row._replace(hash="0" * 16) for row in result.rows))
    otherwise.write(file)
    code, _, err = run(capsys, "leaderboard", "--verify", file)
    assert (code, "2 did not go as it says, the first world" in err) == (1, True)

    # Another maker may have reached as much on another way.
    elsewhere = result.made_by | {"machine": {"processor": "Abacus\x1b[31m"}}
    replace(otherwise, made_by=elsewhere).write(file)
    code, out, _ = run(capsys, "leaderboard", "--verify", file)
    told = "2 reached as much with another hash; played by other libraries or another system than"
    assert (code, f"drawn by lot, {told}" in out, "\x1b" in out) == (0, True, False)
    forged = [row._replace(reached=row.reachable - row.reached) for row in result.rows]
    elsewhere = result.made_by | {"versions": {"code": "0"}}
    replace(result, rows=tuple(forged), made_by=elsewhere).write(file)
    code, _, err = run(capsys, "leaderboard", "--verify", file)
    assert (code, "2 did not go as it says, the first world" in err) == (1, True)
    assert "played by other code than here" in err


def test_one_that_throws_is_named_and_the_other_has_its_file(capsys, here, monkeypatch):
    test = next(world for world in published_worlds() if world.part == "tests")
    monkeypatch.setattr("care_sim.commands.benchmark.quick_tenth", lambda _worlds: [test])
    (here / "thrower.py").write_text(THROWING)
    code, out, err = run(
        capsys, "benchmark", "--policy", "thrower:Throwing", "history", "--quick", "--workers", 1
    )
    assert code == 1
    assert [path.name for path in (here / "runs" / "benchmark").glob("*.json")] == [
        "history.quick.json"
    ]
    at_once, at_the_end = [line for line in err.splitlines() if "failed" in line]
    assert at_once.endswith("; the others go on, Ctrl-C stops")
    assert err.index(at_once) < err.index(" took ") < err.index(at_the_end)
    for line in (at_once, at_the_end):
        assert "thrower:Throwing" in line
        assert "RuntimeError: no idea (thrower.py, line 6)" in line
    assert "Throwing" not in out


def test_a_policy_of_others_cannot_reach_the_environment(capsys, here, monkeypatch):
    test = next(world for world in published_worlds() if world.part == "tests")
    monkeypatch.setattr("care_sim.commands.benchmark.quick_tenth", lambda _worlds: [test])
    (here / "spy.py").write_text(SPY)
    code, out, err = run(
        capsys, "benchmark", "--policy", "spy:Spy", "spy:Oracle", "--quick", "--workers", 1
    )
    assert (code, "spy" in sys.modules) == (1, False)
    assert "Result: runs/benchmark/spy-Spy.quick.json" in out
    told = [line for line in err.splitlines() if line.startswith("care-sim: ")]
    assert {*told} == {
        "care-sim: left out: policy spy:Oracle knows the truth, and the benchmark plays none"
    }


def test_a_sealed_set_is_played_and_verified_by_its_salt_alone(capsys, here, monkeypatch):
    for command in ("benchmark", "leaderboard"):
        monkeypatch.setattr(
            f"care_sim.commands.{command}.screened_worlds",
            lambda _player, salt: [suite.World("tests", 0, salt.seed("tests", 0), 1)],
        )
    monkeypatch.setattr("care_sim.study.benchmark.result.SIZES", {"tests": 1})
    (here / "salt.txt").write_text("0123456789abcdef" * 4)
    (here / "other.txt").write_text("fedcba9876543210" * 4)
    played = run(
        capsys, "benchmark", "--policy", "history", "--sealed", "salt.txt", "--out", "sealed"
    )
    assert played[0] == 0
    text = (here / "sealed" / "history.sealed.json").read_text()
    seed = suite.Salt.read(here / "salt.txt").seed("tests", 0)
    assert str(seed) not in text
    assert json.loads(text)["sealed"][:12] in played[1]
    assert run(capsys, "leaderboard", "sealed")[0] == 0
    assert run(capsys, "leaderboard", "--verify", "sealed", "--sealed", "salt.txt")[0] == 0
    for words in ([], ["--sealed", "other.txt"]):
        code, _, err = run(capsys, "leaderboard", "--verify", "sealed", *words)
        assert (code, "sealed by the salt" in err) == (1, True)

    # A world that the salt draws, and the screening passed over.
    other = text.replace('"measured", 0,', '"measured", 1,').replace('"ideal", 0,', '"ideal", 1,')
    (here / "sealed" / "other.json").write_text(other)
    code, _, err = run(
        capsys, "leaderboard", "--verify", "sealed/other.json", "--sealed", "salt.txt"
    )
    assert code == 1
    assert "other.json: 1 of its worlds are not what the salt draws" in err
    (here / "sealed" / "other.json").write_text(other.replace('"history"', '"care"'))
    code, out, err = run(capsys, "leaderboard", "sealed")
    assert (code, out.count("CARE-Sim benchmark 1:")) == (1, 2)
    assert "other.json has a table of its own" in err


@pytest.mark.parametrize("policy", ["absent:Mine", "math:pi", "history-oracle"])
def test_a_policy_that_cannot_take_part_is_left_out_and_then_none_is_left(capsys, here, policy):
    code, out, err = run(capsys, "benchmark", "--policy", policy)
    assert (code, out) == (2, "")
    assert err.endswith("care-sim: none of the policies can be played\n")
