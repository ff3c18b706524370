"""An environment and its policy that are copied or pickled in mid-episode play on as if alone."""

import copy
import pickle
from dataclasses import dataclass
from itertools import count, islice

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.certify.design import AS_LISTED, CLOSED, DRIVE, REPLAY, STREET, drawn
from care_sim.certify.playing import write_drive
from care_sim.envs.scenarios import ScenarioEnv
from care_sim.scenarios.dartout import Dartout
from tests.envs.test_determinism import digest

SHORT = 16
"""Keyframes of the longest episode that is drawn."""


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    return write_drive(tmp_path_factory.mktemp("drive"))


def draws(environment, first, last):
    """Episodes of the published list: their conditions, policies and seeds."""
    # Policies of `AS_LISTED` play whole episodes before their first keyframe.
    fitting = (
        episode
        for episode in map(drawn, count())
        if episode.environment == environment
        and episode.policy not in AS_LISTED
        and episode.keyframes <= SHORT
    )
    return sorted(islice(fitting, first, last), key=lambda episode: episode.seed)


def play(env, policy, observation, keyframes):
    """The last observation, and all that was seen and done."""
    seen = []
    for _ in range(keyframes):
        action = policy(observation)
        observation, reward, terminated, truncated, _ = env.step(action)
        seen.append(observation | {"action": action, "reward": np.array(reward)})
        if terminated or truncated:
            break
    return observation, seen


# 200 draws, a few of which take seconds.
@pytest.mark.parametrize(("first", "last"), [(0, 4), pytest.param(4, 25, marks=pytest.mark.slow)])
@pytest.mark.parametrize("environment", [*CLOSED, STREET, REPLAY])
def test_a_copy_and_the_original_play_on_as_if_alone(environment, first, last, source):
    for number, episode in enumerate(draws(environment, first, last)):
        arguments, keyframes = dict(episode.arguments), episode.keyframes
        if environment == REPLAY:
            arguments["source"] = source
        elif environment == DRIVE:
            # PyBullet draws the pictures of its six cameras in a second.
            arguments["engine"] = "bullet" if number == 1 else "fast"
            keyframes = 2 if number == 1 else min(keyframes, 8)
        elif environment in CLOSED:
            arguments["engine"] = ("fast", "bullet")[number % 2]
        env = gymnasium.make(environment, disable_env_checker=True, **arguments)
        policy = care_sim.make_policy(episode.policy, env)

        first, _ = env.reset(seed=episode.seed)
        policy.reset()
        _, alone = play(env, policy, first, keyframes)

        first, _ = env.reset(seed=episode.seed)
        policy.reset()
        before = number % keyframes
        middle, begun = play(env, policy, first, before)
        copies = [copy.deepcopy((env, policy)), pickle.loads(pickle.dumps((env, policy)))]
        # The copies first: the original must not feel them.
        for one in (*copies, (env, policy)):
            _, rest = play(*one, middle, keyframes - before)
            assert digest(begun + rest) == digest(alone), episode
            one[0].close()


def outcome_of(env, policy, observation):
    """The outcome of an episode that is played to its end."""
    over = False
    while not over:
        observation, _, terminated, truncated, info = env.step(policy(observation))
        over = terminated or truncated
    return info["outcome"]


def test_a_copy_that_plays_ahead_leaves_the_outcome_of_the_original():
    outcomes = []
    for looks_ahead in (False, True):
        with gymnasium.make("CARE-CutIn-v0", budget=0.1, disable_env_checker=True) as env:
            policy = care_sim.make_policy("care", env)
            observation, _ = env.reset(seed=0)
            policy.reset()
            observation, _ = play(env, policy, observation, 20)
            if looks_ahead:
                play(*copy.deepcopy((env, policy)), observation, 30)
            outcomes.append(outcome_of(env, policy, observation))
    assert outcomes[0] == outcomes[1]
    assert outcomes[0]["braked"]


def test_a_copied_world_takes_in_bodies_where_the_others_are():
    world = Dartout().build(np.random.default_rng(0))
    world.advance(0.0, 0.5)
    copied = copy.deepcopy(world)
    for one in (world, copied):
        one.advance(0.0, 0.5)
        one.add("late car", "car", (60.0, 7.0, 0.0))
    assert copied.centre_of(copied.ego_body) == world.centre_of(world.ego_body)
    world.close()
    copied.close()


@dataclass(frozen=True)
class Tied(Dartout):
    """A person whose motion and event are a closure over the world."""

    def build(self, rng):
        world = super().build(rng)
        world.at(1.0, lambda: world.drawn.clear())
        return world


class Steps:
    """Takes each of its steps off a list."""

    def __init__(self):
        self.take = [0.01 * number for number in range(500)].pop

    def pose(self, _time):
        return 20.0, self.take(), 0.0


@dataclass(frozen=True)
class Popping(Dartout):
    """A person who is moved by the method of a list."""

    def build(self, rng):
        world = super().build(rng)
        world.add("walker", "pedestrian", Steps().pose)
        return world


@dataclass(frozen=True)
class Even(Dartout):
    """A car whose motion is a closure over numbers, which never change."""

    def build(self, rng):
        world = super().build(rng)
        speed = float(rng.uniform(3.0, 4.0))
        world.add("car", "car", lambda time: (60.0 + speed * time, 3.5, 0.0))
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


@pytest.mark.parametrize("copied", [copy.deepcopy, pickle.dumps])
def test_a_scenario_that_holds_the_method_of_a_list_is_refused(copied):
    with ScenarioEnv(scenario=Popping) as env:
        env.reset(seed=0)
        with pytest.raises(InvalidInput, match=r"cannot be copied: list\.pop is held as a method"):
            copied(env)


def test_a_closure_over_numbers_is_copied():
    with ScenarioEnv(scenario=Even) as env:
        observation, _ = env.reset(seed=0)
        policy = care_sim.make_policy("care", env)
        other, same = copy.deepcopy((env, policy))
        assert digest([play(other, same, observation, 5)[0]]) == digest(
            [play(env, policy, observation, 5)[0]]
        )
