"""The reward that all environments share: chances of a first detection that were missed."""

from dataclasses import replace

import numpy as np
import pytest

from care_sim.envs import make_env
from care_sim.envs.open_loop import FilmEnv
from care_sim.training.drawn import MissedChances
from tests.helpers.handmade_film import BEHIND, BESIDE, ENTRY, WALKER, handmade_film, returns_of


def played(env, choose, seed=0):
    """Rewards of an episode."""
    env.reset(seed=seed)
    rewards, over = [], False
    while not over:
        _, reward, terminated, truncated, _ = env.step(choose())
        rewards.append(reward)
        over = terminated or truncated
    env.close()
    return rewards


@pytest.mark.parametrize("name", ["CARE-Dense-v0", "CARE-NCAP-v0", "CARE-Drive-v0"])
def test_the_full_scan_misses_none(name):
    env = MissedChances(make_env(name, budget=1.0))
    seen = np.ones(env.action_space.shape, np.float32)
    # A drive in which somebody comes out.
    assert set(played(env, lambda: seen, seed=10_002)) == {0.0}


def test_who_never_fires_misses_every_keyframe_at_which_a_full_scan_would_detect():
    env = MissedChances(make_env("CARE-Dense-v0", floor=False))
    nothing = np.zeros(env.action_space.shape, np.float32)
    detectable = []

    def choose():
        detectable.append(env.unwrapped.loop.detectable())
        return nothing

    rewards = played(env, choose)
    assert [-reward for reward in rewards] == detectable
    assert 5 < sum(detectable) < len(detectable)


def test_who_was_detected_once_is_no_chance_any_more():
    env = MissedChances(make_env("CARE-Dense-v0", budget=1.0, floor=False))
    shape, keyframes = env.action_space.shape, []

    def choose():
        keyframes.append(len(keyframes))
        return np.full(shape, float(len(keyframes) == 30), np.float32)

    rewards = played(env, choose)
    assert sum(rewards[:29]) < 0
    assert set(rewards[29:]) == {0.0}


def test_of_a_drive_everybody_counts_whom_it_lets_the_ego_meet():
    env = MissedChances(make_env("CARE-Drive-v0", floor=False, encounters=3))
    nothing = np.zeros(env.action_space.shape, np.float32)
    most = []

    def choose():
        loop = env.unwrapped.loop
        most.append(sum(loop.would_detect(one.body) for one in loop.world.meetings))
        return nothing

    rewards = played(env, choose, seed=10_002)
    assert [-reward for reward in rewards] == most
    assert sum(most) > 5


def scores(*numbers, index):
    action = np.zeros((32, 512), np.float32)
    for number in numbers:
        action.ravel()[returns_of(number, index)] = 1.0
    return action


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        # Present at the start: AHEAD. First sightings: the WALKER at keyframe 1, the others at 2.
        ([(), (), ()], [0, -1, -4]),
        ([(), (WALKER,), ()], [0, 0, -3]),
        ([(), (WALKER,), (BESIDE, BEHIND)], [0, 0, -1]),
        ([(), (), (WALKER,)], [0, -1, -3]),
    ],
)
def test_of_a_scene_the_first_sightings_count(found, expected):
    env = MissedChances(FilmEnv(handmade_film(), budget=0.5, floor=False))
    actions = (scores(*numbers, index=index) for index, numbers in enumerate(found))
    assert played(env, lambda: next(actions)) == expected


def test_an_event_counts_until_it_is_censored():
    """The four first sightings cost 1 at each of K = 6 keyframes and nothing after."""
    env = MissedChances(FilmEnv(handmade_film(10), budget=0.5, floor=False))
    nothing = np.zeros((32, 512), np.float32)
    assert played(env, lambda: nothing) == [0, -1, *[-4] * 5, -3, 0, 0]


def test_who_is_out_of_range_or_gone_is_no_chance():
    """The bus is beyond 50 m and two are gone again, at keyframes 2 and 3."""
    film = handmade_film()
    near, far = film.shots[ENTRY], film.shots[1]
    film = replace(film, shots=(film.shots[0], near, far, far))
    env = MissedChances(FilmEnv(film, budget=0.5, floor=False))
    nothing = np.zeros((32, 512), np.float32)
    assert played(env, lambda: nothing) == [0, -4, -1, -1]


def test_observation_and_end_stay_as_they_are():
    env, own = MissedChances(make_env("CARE-Dense-v0")), make_env("CARE-Dense-v0")
    one, other = env.reset(seed=1)[0], own.reset(seed=1)[0]
    np.testing.assert_equal(one, other)
    np.testing.assert_equal(
        env.step(np.zeros((32, 512), np.float32))[0], own.step(np.zeros((32, 512), np.float32))[0]
    )
    env.close()
    own.close()
