"""A scenario from outside: the documented example, installed, through the same doors as ours."""

import subprocess
import sys
import tomllib

import gymnasium
import numpy as np
import pytest

from care_sim.base.errors import BrokenScenario, InvalidInput
from care_sim.cli import main
from care_sim.envs import register_all
from care_sim.envs.scenarios import ScenarioEnv
from care_sim.reports.report import read_results
from care_sim.scenarios import PLUGINS, SCENARIOS, make_scenario, scenario_names
from care_sim.scenarios.dartout import Dartout
from care_sim.scenarios.drive import DriveScenario
from care_sim.training.config import PpoConfig
from care_sim.training.environments import plain
from tests.helpers.places import ROOT, example, fenced

LEFT_BIKE = example("scenario")
TOML = fenced(ROOT / "docs" / "write" / "scenario.md", "toml")[0]
(ENTRY,) = tomllib.loads(TOML)["project"]["entry-points"][PLUGINS.group].items()


@pytest.fixture
def installed(install, monkeypatch):
    """As the page says, and as it is registered when CARE-Sim is imported."""
    before = {*gymnasium.registry}
    install("leftbike", LEFT_BIKE, PLUGINS.group, **{ENTRY[0]: "LeftBike"})
    register_all()
    yield
    for name in {*gymnasium.registry} - before:
        del gymnasium.registry[name]


def run(*arguments):
    with pytest.raises(SystemExit) as end:
        main([*map(str, arguments)])
    return end.value.code


def test_its_name_and_its_environment_are_known(installed):
    assert scenario_names() == [*SCENARIOS, "leftbike"]
    env = gymnasium.make("Mine-LeftBike-v0", budget=0.05, ride_mps=(4.0, 4.0))
    env.reset(seed=1)
    assert env.unwrapped.scenario == make_scenario("leftbike", ride_mps=(4.0, 4.0))
    assert env.unwrapped.loop.world.first_sighting.name == "cyclist"
    env.close()


def test_import_registers_it_without_loading_it(installed):
    code = (
        "import sys, care_sim, gymnasium; "
        "print('Mine-LeftBike-v0' in gymnasium.registry, 'leftbike' in sys.modules)"
    )
    path = {"PYTHONPATH": ":".join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", code], env=path, capture_output=True, text=True, check=True
    )
    assert done.stdout == "True False\n"


def test_a_sweep_plays_it_in_processes_of_their_own(installed, tmp_path, capsys):
    command = ["sweep", "--scenarios", "leftbike", "--policies", "care", "--budgets", "0.05"]
    command += ["--seeds", "1", "--workers", "1", "--scenario-parameters", "duration_s=3.0"]
    assert run(*command, "--out", tmp_path / "out") == 0
    (row,) = read_results(tmp_path / "out")[0]
    assert (row["scenario"], row["scenario.duration_s"]) == ("leftbike", 3.0)
    assert row["rays_fired"] == 30 * 819
    # Asked again, it is found: the worker's digest is that of this process.
    assert run(*command, "--out", tmp_path / "out") == 0
    assert "1 of 1 episodes found" in capsys.readouterr().err


def test_by_its_place_it_is_the_same(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    (tmp_path / "placed_bike.py").write_text(LEFT_BIKE)
    run("run", "placed_bike:LeftBike", "--scenario-parameters", "duration_s=0.5")
    assert "placed_bike:LeftBike care 0.1 seed 0" in capsys.readouterr().out
    with plain(PpoConfig(env="placed_bike:LeftBike", env_parameters=("ride_mps=4,4",))) as env:
        assert env.unwrapped.scenario.ride_mps == (4.0, 4.0)
    assert "placed_bike:LeftBike" not in scenario_names()


BROKEN = """
from dataclasses import dataclass, field
from care_sim.scenarios.base import Scenario
from care_sim.scenarios.dartout import Dartout
from care_sim.scenarios.drive import DriveScenario

module = "a string"

class Other: ...

@dataclass(frozen=True)
class Abstract(Scenario): ...

class Plain(Dartout):
    ride_mps: float = 3.0

@dataclass(frozen=True)
class Needy(Dartout):
    names: tuple = field(default_factory=tuple)

@dataclass(frozen=True)
class Blind(Dartout):
    cameras = ("front",)

@dataclass(frozen=True)
class Nothing(Dartout):
    def build(self, rng): ...

@dataclass(frozen=True)
class Exploding(Dartout):
    def build(self, rng):
        raise KeyError("street")

@dataclass(frozen=True)
class Nobody(Dartout):
    def build(self, rng):
        world = super().build(rng)
        world.first_sighting = None
        return world

@dataclass(frozen=True)
class Refusing(Dartout):
    def __post_init__(self):
        raise RuntimeError("today")

@dataclass(frozen=True)
class Greedy(Dartout):
    budget: float = 1.0
"""
UNSOUND = {
    "string": ("module", "broken_worlds:module is no Scenario"),
    "other": ("Other", "broken_worlds:Other is no Scenario"),
    "abstract": ("Abstract", "broken_worlds:Abstract is abstract: it lacks build"),
    "plain": ("Plain", "broken_worlds:Plain is no dataclass: @dataclass"),
    "needy": ("Needy", "broken_worlds:Needy has no default for names"),
    "blind": ("Blind", r"broken_worlds:Blind has the cameras \('front',\); allowed is a tuple"),
    "torn": ("Nowhere", "AttributeError: .*Nowhere"),
}
UNBUILT = {
    "nothing": ("Nothing", "broken_worlds:Nothing: build must return a World, got NoneType"),
    "exploding": ("Exploding", "broken_worlds:Exploding cannot be built: KeyError: 'street'"),
    "nobody": ("Nobody", "broken_worlds:Nobody: build sets no first_sighting"),
    "refusing": ("Refusing", "scenario refusing refuses to start: RuntimeError: today"),
    "greedy": ("Greedy", "broken_worlds:Greedy has the parameter budget, which is an argument"),
}


@pytest.fixture
def broken(install):
    names = {name: thing for name, (thing, _) in (UNSOUND | UNBUILT).items()}
    install("broken_worlds", BROKEN, PLUGINS.group, **names)
    install("leaving_worlds", "raise SystemExit(3)", PLUGINS.group, leaving="Gone")


@pytest.mark.parametrize("name", UNSOUND)
def test_one_that_cannot_be_loaded_is_named_with_the_reason(broken, name):
    with pytest.raises(
        BrokenScenario, match=f"scenario {name} cannot be loaded: {UNSOUND[name][1]}"
    ):
        make_scenario(name)


@pytest.mark.parametrize("name", UNBUILT)
def test_one_whose_world_cannot_be_built_is_named_with_the_reason(broken, name):
    with pytest.raises(BrokenScenario, match=UNBUILT[name][1]):
        ScenarioEnv(scenario=name).reset(seed=0)


def test_a_sweep_leaves_broken_ones_out_and_plays_the_others(broken, installed, tmp_path, capsys):
    names = ["leaving", "nothing", "torn", "leftbike"]
    options = ["--policies", "random", "--seeds", "1", "--workers", "1", "--out", tmp_path / "out"]
    short = ["--scenario-parameters", "duration_s=0.5"]
    assert run("sweep", "--scenarios", *names, *options, *short) == 1
    told = capsys.readouterr().err
    assert "left out: scenario leaving cannot be loaded: SystemExit: 3" in told
    assert "left out: scenario broken_worlds:Nothing: build must return a World" in told
    (row,) = read_results(tmp_path / "out")[0]
    assert row["scenario"] == "leftbike"
    assert run("sweep", "--scenarios", "torn", *options) == 2
    assert "none of the scenarios can be played" in capsys.readouterr().err


def test_a_built_in_name_cannot_be_taken(install, capsys):
    before = {*gymnasium.registry}
    install("usurper_world", LEFT_BIKE, PLUGINS.group, **{"Mine-Dartout-v0": "LeftBike"})
    refusal = "scenario dartout of usurper_world 1.5 is refused: the built-in one has its name"
    assert type(make_scenario("dartout")) is Dartout
    register_all()
    with pytest.raises(InvalidInput, match=f"environment Mine-Dartout-v0: {refusal}"):
        gymnasium.make("Mine-Dartout-v0")
    for name in {*gymnasium.registry} - before:
        del gymnasium.registry[name]
    assert run("scenarios") == 0
    assert capsys.readouterr().out.endswith(f"{refusal}\n")
    assert run("sweep", "--scenarios", "dartout", "--policies", "nobody") == 2
    assert refusal in capsys.readouterr().err


def test_the_list_tells_it_and_what_is_broken(installed, broken, capsys):
    assert run("scenarios") == 0
    # Lines are broken where the terminal ends.
    told = capsys.readouterr().out.replace("\n        ", " ")
    first = "A cyclist rides out of a gateway on the left, behind a parked trailer."
    assert f"leftbike     {first} [Mine-LeftBike-v0, leftbike 1.5]\n" in told
    assert "    ride_mps=3.5,4.5 (0.5 to 10)\n" in told
    assert "torn         (broken) scenario torn cannot be loaded: AttributeError" in told
    assert "[leaving_worlds 1.5]" in told


def test_a_drive_of_ones_own_is_scored_as_a_drive():
    own = type("OwnDrive", (DriveScenario,), {})
    outcomes = []
    for env in (
        ScenarioEnv(scenario=own, duration_s=1.0),
        gymnasium.make("CARE-Drive-v0", duration_s=1.0),
    ):
        env.reset(seed=0)
        over = False
        while not over:
            *_, terminated, truncated, info = env.step(np.zeros(env.action_space.shape, np.float32))
            over = terminated or truncated
        outcomes.append(info["outcome"])
        env.close()
    assert outcomes[0] == outcomes[1]
    assert "progress" in outcomes[0]


def test_a_class_is_played_without_a_name():
    own = type("Quiet", (Dartout,), {"__doc__": "As it is."})
    with ScenarioEnv(scenario=own, ego_speed_mps=(7.0, 7.0)) as env:
        _, info = env.reset(seed=0)
    assert np.isclose(env.scenario.ego_speed_mps, 7.0).all()
    assert info["seed"] == 0
    with pytest.raises(BrokenScenario, match="is no Scenario"):
        ScenarioEnv(scenario=int)
