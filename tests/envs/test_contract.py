"""Rules that every environment keeps, read off one episode of each that is played once."""

import re
from dataclasses import fields

import gymnasium
import numpy as np
import pytest

from care_sim.envs import CLOSED_LOOP
from care_sim.envs.closed_loop import ClosedLoopEnv
from care_sim.envs.open_loop import OpenLoopEnv
from care_sim.envs.reward import REWARD_WEIGHTS
from care_sim.evaluation.recall import SceneOutcome
from care_sim.loops.records import DriveOutcome, Outcome
from tests.helpers.episodes import played

SEED = 3
OWN = {"fired", "time_s"}
"""Keys of `info` that a car knows; in the closed loop also `braking`."""
SOMETIMES = {"intensities", "times_s"}
"""Not every return has strength and an instant."""


def same(one, other):
    return all(np.array_equal(one[key], other[key]) for key in one)


@pytest.fixture(scope="module", params=[*CLOSED_LOOP, "CARE-Replay-v0"])
def make(request, drive):
    """Makes environments of one id, with short episodes."""
    closed = request.param in CLOSED_LOOP
    given = {"duration_s": 1.5} if closed else {"source": f"argoverse2:{drive}"}
    return lambda **arguments: gymnasium.make(
        request.param, disable_env_checker=True, **given, **arguments
    )


@pytest.fixture(scope="module")
def episode(make):
    with make() as env:
        return env.unwrapped, played(env, "care", SEED)


@pytest.mark.smoke
def test_an_episode_stays_inside_its_spaces_and_ends(episode):
    env, (begun, *steps) = episode
    assert env.observation_space.contains(begun[0])
    assert begun[4]["seed"] == SEED
    for observation, reward, *_, info in steps:
        assert env.observation_space.contains(observation)
        assert reward <= 0.0
        assert len(info["fired"]) == env.rig.budget
        if isinstance(env, ClosedLoopEnv):
            assert [*info["reward_terms"]] == [*REWARD_WEIGHTS]
    assert ["outcome" in info for *_, info in steps] == [False] * (len(steps) - 1) + [True]
    kind = DriveOutcome if type(env).__name__ == "DriveEnv" else Outcome
    kind = kind if isinstance(env, ClosedLoopEnv) else SceneOutcome
    outcome = steps[-1][4]["outcome"]
    assert [*outcome] == [field.name for field in fields(kind)]
    assert outcome.get("rays_fired", len(steps) * env.rig.budget) == len(steps) * env.rig.budget


def listed(text):
    """The keys before the colons of a list's items."""
    items = re.findall(r"^ *- (`[^:]*):", text, re.MULTILINE)
    return set(re.findall(r"`(\w+)`", " ".join(items)))


def test_every_key_of_info_is_listed_as_the_cars_own_or_for_scoring_alone(episode):
    env, steps = episode
    kind = ClosedLoopEnv if isinstance(env, ClosedLoopEnv) else OpenLoopEnv
    section = kind.__doc__.partition("### Info")[2].partition("### Arguments")[0]
    readable, scoring = map(listed, section.split("Entries for scoring alone"))
    told = {key for *_, info in steps for key in info}
    assert told <= readable | scoring <= told | {"drawn"} | SOMETIMES
    own = OWN | ({"braking"} if kind is ClosedLoopEnv else set())
    assert readable == own | SOMETIMES


def test_the_seed_plays_it_again_and_without_scoring_info_the_truth_alone_is_left_out(
    make, episode
):
    _, steps = episode
    with make(scoring_info=False) as env:
        again = played(env, "care", SEED)
    own = OWN | ({"braking"} if isinstance(env.unwrapped, ClosedLoopEnv) else set())
    assert again[0][4] == {}
    for (*answer, info), (*other, less) in zip(steps, again, strict=True):
        np.testing.assert_equal(answer, other)
        np.testing.assert_equal({key: info[key] for key in less}, less)
    assert all(set(info) == own for *_, info in again[1:-1])
    assert set(again[-1][4]) == own | {"outcome"}


def test_another_seed_and_a_secret_make_another_episode(make):
    faults = {"false_negative_rate": 0.5, "lidar_dropout": 0.5}
    with make(**faults) as env, make(secret="6d0f5b7e", **faults) as secret:
        told = [
            [observation for observation, *_ in played(one, "care", seed, keyframes=3)]
            for one, seed in ((env, SEED), (env, SEED + 1), (secret, SEED), (secret, SEED))
        ]
    assert all(map(same, told[2], told[3]))
    for one, other in ((0, 1), (0, 2)):
        assert not any(map(same, told[one][1:], told[other][1:]))
