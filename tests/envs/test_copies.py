"""An environment and its policy that are copied or pickled in mid-episode play on as if alone."""

import copy
import pickle
from dataclasses import dataclass

import gymnasium
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.envs.scenarios import ScenarioEnv
from care_sim.scenarios.dartout import Dartout
from tests.helpers.short_streets import few_and_short
from tests.helpers.vectors import difference

FAULTS = {
    "camera_latency": 1,
    "camera_jitter": 1,
    "false_negative_rate": 0.3,
    "lidar_dropout": 0.2,
    "lidar_range_sigma": 0.05,
    "ego_speed_sigma": 0.2,
}
CASES = [
    ("CARE-Dense-v0", "care", FAULTS | {"lidar_sweep_s": 0.1}),
    ("CARE-Dartout-v0", "random", {"engine": "bullet", "camera_profile": "yolox"}),
    ("CARE-CutIn-v0", "history", {"detector": "cluster", "firing": "azimuth-window"}),
    ("CARE-R157-v0", "learned-sets", {"driver": "careful-human", "detector": "centerpoint"}),
    ("CARE-NCAP-v0", "care-sector", {"test": "CPTAns-50", "speed_kph": 10.0}),
    ("CARE-Drive-v0", "care-sightlines", FAULTS),
    ("CARE-Street-v0", "care", FAULTS | {"lidar_sweep_s": 0.1}),
    ("CARE-Replay-v0", "all-camera", FAULTS),
]


def play(env, policy, observation, steps):
    """The last observation, and all that was done and given."""
    told = []
    for _ in range(steps):
        action = policy(observation)
        observation, *rest = env.step(action)
        told.append(copy.deepcopy({"a": action, "o": observation, **dict(enumerate(rest))}))
    return observation, dict(enumerate(told))


@pytest.mark.parametrize(("name", "policy", "arguments"), CASES, ids=[name for name, *_ in CASES])
def test_a_copy_and_the_original_play_on_as_if_alone(name, policy, arguments, drive):
    if name == "CARE-Replay-v0":
        arguments = arguments | {"source": f"argoverse2:{drive}"}
    with few_and_short():
        found = []
        for copies in (False, True):
            env = gymnasium.make(name, disable_env_checker=True, budget=0.05, **arguments)
            both = env, care_sim.make_policy(policy, env)
            observation, _ = env.reset(seed=3)
            both[1].reset()
            middle, _ = play(*both, observation, 3)
            takes = (copy.deepcopy(both), pickle.loads(pickle.dumps(both))) if copies else ()
            # The copies first: the original must not feel them.
            for one in (*takes, both):
                found.append(play(*one, middle, 5)[1])
                one[0].close()
    assert [difference(one, found[0]) for one in found[1:]] == [None] * 3


@dataclass(frozen=True)
class Tied(Dartout):
    """A person whose motion and event are a closure over the world."""

    def build(self, rng):
        world = super().build(rng)
        world.at(1.0, lambda: world.drawn.clear())
        return world


@pytest.mark.parametrize("copied", [copy.deepcopy, pickle.dumps])
def test_a_scenario_with_a_closure_over_its_world_is_refused_in_one_line(copied):
    with ScenarioEnv(scenario=Tied) as env:
        env.reset(seed=0)
        with pytest.raises(InvalidInput) as refused:
            copied(env)
    message = str(refused.value)
    assert message.startswith("scenario tests.envs.test_copies:Tied cannot be copied: Tied.build.")
    assert "(test_copies.py, line " in message
    assert "\n" not in message
