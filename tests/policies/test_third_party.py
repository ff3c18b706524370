"""A policy from outside, found by its entry point, through the same door as ours."""

import sys

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import BrokenPolicy, InvalidInput
from care_sim.cli import main
from care_sim.commands.shared.selection import playable
from care_sim.policies import BUILT_IN, policy_names, tags_of
from care_sim.study.episode_config import grid

MODULE = '''
import numpy as np
import care_sim


class Horizon(care_sim.Policy):
    """Beam reduction: the rows nearest to the horizon, every second column."""

    name = "horizon"

    def __init__(self, rig, rows=4):
        super().__init__(rig)
        self.rows = rows

    def demand(self, belief):
        grid = self.rig.grid
        row = np.argsort(np.abs(grid.directions[:: grid.columns, 2]), kind="stable")[: self.rows]
        cells = row[:, None] * grid.columns + np.arange(0, grid.columns, 2)
        return care_sim.Demand(layers=[[cells.ravel()]])
'''


@pytest.fixture
def installed(install):
    install("horizon_policy", MODULE, horizon="Horizon")


@pytest.fixture
def env():
    made = gymnasium.make("CARE-Dartout-v0", budget=0.1)
    yield made
    made.close()


def test_an_installed_policy_is_listed_made_and_driven(installed, env):
    assert "horizon" in care_sim.policy_names()
    policy = care_sim.make_policy("horizon", env, rows=3)
    observation, _ = env.reset(seed=0)
    for _ in range(3):
        action = policy(observation)
        observation, *_, info = env.step(action)
        assert np.count_nonzero(action) == 3 * 256
        assert set(np.flatnonzero(action).tolist()) <= set(info["fired"].tolist())
        assert len(info["fired"]) == 1638


class Greedy(care_sim.Policy):
    """Asks for far more than it may fire."""

    name = "greedy"

    def demand(self, belief):
        everything = np.arange(self.rig.grid.size)
        return care_sim.Demand([everything, everything[::-1]], [[everything]])


class Lost(care_sim.Policy):
    """Asks for cells that no grid has."""

    name = "lost"

    def __init__(self, rig, cell):
        super().__init__(rig)
        self.cell = cell

    def demand(self, belief):
        return care_sim.Demand([np.array([5, self.cell])])


def test_no_demand_can_overspend(env):
    observation, _ = env.reset(seed=0)
    action = Greedy(env.unwrapped.rig)(observation)
    *_, info = env.step(action)
    assert np.count_nonzero(action) == len(info["fired"]) == 1638


@pytest.mark.parametrize("cell", [-1, 16384])
def test_cells_off_the_grid_are_refused_with_the_policys_name(env, cell):
    observation, _ = env.reset(seed=0)
    with pytest.raises(InvalidInput, match=r"policy lost: cells must lie in 0\.\.16383"):
        Lost(env.unwrapped.rig, cell)(observation)


BROKEN = """
import care_sim

module = "a string"

class Abstract(care_sim.Policy):
    name = "abstract"

class Mistagged(care_sim.Policy):
    tags = ("wise",)
    def demand(self, belief): ...

class Exploding(care_sim.Policy):
    def __init__(self, rig):
        raise KeyError("weights")
    def demand(self, belief): ...

class Deaf(care_sim.Policy):
    def __init__(self): ...
    def demand(self, belief): ...

def nothing(rig): ...

class Sourced(Mistagged):
    tags, source = ("causal",), ("a book", "a page")

silent = max

class Spying(care_sim.Policy):
    told = {"env": "unwrapped"}
    def __init__(self, rig, env=None):
        super().__init__(rig)
    def demand(self, belief): ...

def honest(rig, bins=3):
    return care_sim.policies.BUILT_IN["history"](rig)
"""

ALLOWED = "; allowed is a mapping of parameters to min_returns or scenario; .*PrivilegedPolicy"
REASONS = {
    "spying": rf"broken:Spying has told \{{'env': 'unwrapped'\}}{ALLOWED}",
    "abstract": r"broken:Abstract is abstract: it lacks demand",
    "mistagged": (
        r"broken:Mistagged has tags \('wise',\); allowed is a tuple of causal, privileged, "
        r".*"
    ),
    "silent": r"broken:silent tells no parameters",
    "sourced": r"broken:Sourced has the source \('a book', 'a page'\); allowed is one line of text",
    "string": r"broken:module is no Policy",
    "torn": r"AttributeError: .*Nowhere",
}


@pytest.fixture
def broken(install):
    install(
        "broken",
        BROKEN,
        abstract="Abstract",
        string="module",
        mistagged="Mistagged",
        sourced="Sourced",
        silent="silent",
        spying="Spying",
        torn="Nowhere",
        exploding="Exploding",
        deaf="Deaf",
        nothing="nothing",
        honest="honest",
    )
    install("leaving", "raise SystemExit(3)", leaving="Gone")


@pytest.mark.parametrize("name", REASONS)
def test_a_policy_that_cannot_be_loaded_is_named_with_the_reason(broken, env, name):
    with pytest.raises(InvalidInput, match=f"policy {name} cannot be loaded: {REASONS[name]}"):
        care_sim.make_policy(name, env)
    assert tags_of(name) == ()


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        (
            "exploding",
            r"policy exploding refuses to start: KeyError: 'weights' \(broken.py, line 15\)",
        ),
        ("deaf", r"policy deaf refuses to start: TypeError: .*positional argument"),
        ("nothing", r"policy nothing is no Policy but of type NoneType"),
    ],
)
def test_a_policy_that_cannot_be_made_is_named_with_the_reason(broken, env, name, reason):
    with pytest.raises(InvalidInput, match=reason):
        care_sim.make_policy(name, env)


class Own(care_sim.Policy):
    """One that nobody has installed."""

    def demand(self, belief):
        """Nothing."""
        raise NotImplementedError


def test_a_class_is_told_the_place_by_which_it_is_asked_for(env):
    place = f"{__name__}:Own"
    with pytest.raises(InvalidInput, match=f"got the class Own: ask for it .* as '{place}'$"):
        care_sim.make_policy(Own, env)
    assert isinstance(care_sim.make_policy(place, env), Own)
    inner = type("Inner", (Own,), {"__qualname__": "f.<locals>.Inner"})
    with pytest.raises(InvalidInput, match=r"MODULE:CLASS, from a module's top$"):
        care_sim.make_policy(inner, env)


def test_broken_policies_do_not_stop_the_others(broken, installed, env):
    assert set(BUILT_IN) | set(REASONS) | {"horizon", "leaving"} <= set(policy_names())
    asked = ["care", "torn", "horizon", "exploding", "leaving", "deaf"]
    sound, lines = playable(asked, lambda name: grid(["dartout", "dense"], [name], [0.1], [0]))
    assert sound == ["care", "horizon"]
    told = [line.removeprefix("left out: ") for line in lines]
    reasons = dict(zip(["torn", "exploding", "leaving", "deaf"], told, strict=True))
    assert (
        reasons["torn"].partition(" (found in ")[0] == "policy torn cannot be loaded: "
        "AttributeError: module 'broken' has no attribute 'Nowhere'"
    )
    assert (
        reasons["leaving"] == "policy leaving cannot be loaded: SystemExit: 3 (leaving.py, line 1)"
    )
    assert (
        reasons["exploding"]
        == "policy exploding refuses to start: KeyError: 'weights' (broken.py, line 15)"
    )
    assert "deaf" in reasons["deaf"]
    assert care_sim.make_policy("horizon", env).name == "horizon"


def test_a_function_that_makes_a_policy_is_one(broken, env):
    assert tags_of("honest") == ("causal",)
    assert care_sim.make_policy("honest", env, bins=4).name == "history"


CONTROLS = '''
import care_sim

class Odd:
    def __repr__(self):
        return "\\x1b]0;x\\x07"

class Loud(care_sim.Policy):
    """Clears \\x1b[2J the screen \\u202e."""

    source = "a paper \\x1b[31m in red\\n and \\x9b more"

    def __init__(self, rig, by=Odd()): ...
    def demand(self, belief): ...

class Near:
    """Rings \\x07 the bell."""

    def detect(self, points): ...
'''


def test_nothing_of_a_policy_or_detector_reaches_the_terminal_but_text(install, capsys):
    install("loud", CONTROLS, **{"loud\x1b[1m": "Loud", "torn\x1b[1m": "Nowhere"})
    install("near_loud", CONTROLS, group="care_sim.detectors", near="Near")
    for kind in ("policies", "detectors"):
        with pytest.raises(SystemExit):
            main(["list", kind])
        out = capsys.readouterr().out
        assert all(line.isprintable() for line in out.splitlines())
        assert "\\x1b" in out or "\\x07" in out
    with pytest.raises(SystemExit):
        main(["run", "dartout", "--policy", "nobody\x1b[31m"])
    assert capsys.readouterr().err.rstrip("\n").isprintable()


def test_a_policy_is_found_by_its_place_in_the_current_folder(tmp_path, monkeypatch, env):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    (tmp_path / "placed_policy.py").write_text(MODULE + "\n\nfewer = lambda rig: Horizon(rig, 1)\n")
    policy = care_sim.make_policy("placed_policy:Horizon", env, rows=3)
    assert policy.rows == 3
    assert care_sim.make_policy("placed_policy:fewer", env).rows == 1
    assert tags_of("placed_policy:Horizon") == ("causal",)
    assert "placed_policy:Horizon" not in policy_names()
    # A file there hides no module of Python or of an installed package.
    (tmp_path / "colorsys.py").write_text("raise SystemExit")
    with pytest.raises(BrokenPolicy, match="rgb_to_hls"):
        care_sim.make_policy("colorsys:rgb_to_hls", env)


@pytest.mark.parametrize("text", [":pi", "a b:c", "1a:b", "a:b:c"])
def test_what_is_no_place_is_an_unknown_name(text, env):
    with pytest.raises(InvalidInput, match="unknown policy"):
        care_sim.make_policy(text, env)
