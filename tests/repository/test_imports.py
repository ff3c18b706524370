"""Libraries that an episode makes a process load: a worker must stay small."""

import json
import pathlib
import re
import subprocess
import sys

import pytest

import care_sim

EPISODE = """
import json, sys
import gymnasium
import care_sim
env = gymnasium.make("CARE-Dense-v0", engine=sys.argv[1])
policy = care_sim.make_policy("care", env)
observation, _ = env.reset(seed=0)
ended = False
while not ended:
    observation, _, terminated, truncated, _ = env.step(policy(observation))
    ended = terminated or truncated
env.close()
print(json.dumps(sorted(sys.modules)))
"""
HEAVY = {
    "dask",
    "distributed",
    "mujoco",
    "open3d",
    "plotly",
    "rerun",
    "rich",
    "sklearn",
    "stable_baselines3",
    "torch",
    "tyro",
}
"""Libraries that an episode does not need. It needs the roads and drivers of highway-env, which
loads its own environments and with them pandas (with PyArrow), Matplotlib and pygame. These take 96
MB and a second of every worker, since no part of highway-env comes without the rest."""


@pytest.mark.parametrize("engine", ["bullet", "fast"])
def test_an_episode_loads_nothing_heavy_that_it_does_not_use(engine):
    played = subprocess.run(
        [sys.executable, "-c", EPISODE, engine], capture_output=True, text=True, check=True
    )
    loaded = set(json.loads(played.stdout.splitlines()[-1]))
    assert {"care_sim", "gymnasium", "pybullet"} <= loaded
    assert {name.partition(".")[0] for name in loaded} & HEAVY == set()
    assert "scipy.stats" not in loaded


@pytest.mark.parametrize(
    ("module", "unused"),
    [
        ("care_sim.cli", {"highway_env", "matplotlib", "pandas", "pybullet"}),
        ("care_sim.commands.shared.run_study", {"highway_env", "pandas", "scipy.stats"}),
        ("care_sim.wrappers", {"rerun"}),
    ],
)
def test_what_only_worlds_need_is_loaded_with_the_first_world(module, unused):
    """It would double the time of every command that plays nothing, such as a report."""
    line = f"import sys, {module}; print(*sys.modules)"
    told = subprocess.run([sys.executable, "-c", line], capture_output=True, text=True, check=True)
    assert unused & {*told.stdout.split()} == set()


def test_only_the_viewer_imports_rerun():
    package = pathlib.Path(care_sim.__file__).parent
    importing = [
        file
        for file in package.rglob("*.py")
        if re.search(r"^\s*(import|from) rerun\b", file.read_text(), re.M)
    ]
    assert importing
    assert {file.parent for file in importing} == {package / "viewer" / "recording"}


THREADS = """
import sys, threading, time
from care_sim.world.traffic import Traffic

inside = threading.Event()

class Slow:
    def find_spec(self, name, *_):
        if name == "highway_env.road.road":
            inside.set()
            time.sleep(0.5)

def build():
    Traffic((1,), 0, 3.5, 14.0).add_stop_line(10.0, 0)

sys.meta_path.insert(0, Slow())
first = threading.Thread(target=build)
first.start()
inside.wait()
import care_sim.world.lane_driver
first.join()
"""
"""The second thread comes by another door, as one that copies a world does, while the first is in
the middle of highway-env."""


def test_threads_that_build_the_first_worlds_at_once_all_find_highway_env_whole():
    """Its modules import each other: a thread that enters it elsewhere gets halves."""
    done = subprocess.run([sys.executable, "-c", THREADS], capture_output=True, text=True)
    assert done.stderr == ""


HIGHWAY = """
import sys
from care_sim.world import lane_driver
assert not {"highway_env", "matplotlib", "pandas", "pygame"} & set(sys.modules)
import gymnasium, highway_env
gymnasium.make("highway-v0").reset(seed=0)
from highway_env.vehicle.behavior import IDMVehicle
assert IDMVehicle is lane_driver.IDMVehicle
"""


def test_traffic_loads_no_environments_of_highway_env_and_leaves_them_to_others():
    done = subprocess.run([sys.executable, "-c", HIGHWAY], capture_output=True, text=True)
    assert done.stderr == ""
