"""The environment of the Euro NCAP tests, with its real parts."""

from contextlib import closing
from functools import partial

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv

import care_sim
from care_sim.scenarios.ncap.table import TESTS

NOTHING = np.zeros((32, 512), np.float32)


def make(**arguments):
    return gymnasium.make("CARE-NCAP-v0", disable_env_checker=True, **arguments)


def outcome(policy, seed=0, **arguments):
    """How an episode ends under a policy, None for one that fires nothing."""
    with make(budget=1.0 if policy == "full" else 0.03, **arguments) as env:
        play = care_sim.make_policy(policy, env) if policy else None
        observation, _ = env.reset(seed=seed)
        steps, ended = 0, False
        while not ended:
            action = play(observation) if play else NOTHING
            observation, _, terminated, truncated, info = env.step(action)
            steps, ended = steps + 1, terminated or truncated
        return info["outcome"], steps, terminated


@pytest.mark.parametrize("name", ["CPNCO-50", "CPLA-50", "CBFA-50", "CPTAns-50", "CCRb"])
def test_the_full_scan_avoids_the_slowest_test(name):
    speeds = TESTS[name].variations[0]
    ended, steps, terminated = outcome(
        "full", test=name, speed_kph=speeds.ego_kph, target_kph=speeds.target_kph
    )
    assert not ended["collision"]
    assert ended["braked"]
    assert terminated
    assert steps < 100


def test_a_car_that_sees_nothing_hits():
    ended, steps, terminated = outcome(None, floor=False)
    assert ended["impact_speed_mps"] == pytest.approx(41 / 3.6, abs=1 / 3.6)
    assert terminated
    assert steps in (40, 41)


def test_its_worlds_ask_for_foresight_themselves():
    """The left turn before an oncoming car, which a brake without it does not avoid."""
    turn = {"test": "CCFtap", "speed_kph": 10.0, "target_kph": 30.0}
    usual = outcome("full", **turn)
    assert usual == outcome("full", brake_for_oncoming=True, **turn)
    assert not usual[0]["collision"]


def test_a_drawn_test_is_told_to_the_scoring_and_its_world_is_that_test():
    with make(budget=0.03, test="drawn", speed_kph=0) as env:
        begun, info = env.reset(seed=4)
        poses = [actor.pose_at(1.0) for actor in env.unwrapped.loop.world.actors]
    assert set(info["drawn"]) == {"test", "speed_kph", "target_kph", "mirrored"}
    with make(budget=0.03, **info["drawn"]) as env:
        same, told = env.reset(seed=4)
        assert poses == [actor.pose_at(1.0) for actor in env.unwrapped.loop.world.actors]
    np.testing.assert_equal(begun, same)
    # What is given is not drawn, and what the seed drew is no one else's.
    assert told == {"seed": 4}
    with make(budget=0.03, test="drawn", speed_kph=0, scoring_info=False) as env:
        assert env.reset(seed=4)[1] == {}


def test_speeds_alone_are_told_where_the_test_is_given():
    with make(budget=0.03, test="CCFtap", speed_kph=0) as env:
        _, info = env.reset(seed=1)
    assert set(info["drawn"]) == {"speed_kph", "target_kph", "mirrored"}


def test_vectors_tell_what_every_world_drew():
    drawn = partial(make, budget=0.03, test="drawn", speed_kph=0)
    with closing(SyncVectorEnv([drawn] * 2)) as vector:
        _, together = vector.reset(seed=4)
    for n in range(2):
        with drawn() as env:
            alone = env.reset(seed=4 + n)[1]["drawn"]
        assert {name: values[n] for name, values in together["drawn"].items() if name in alone} == (
            alone
        )


def test_the_readings_differ_in_what_is_known_of_the_cars_alone():
    seen = []
    for reported in (True, False):
        with make(budget=0.03, occluder_reported=reported) as env:
            observation, _ = env.reset(seed=0)
            world = env.unwrapped.loop.world
            seen.append(([actor.pose_at(0.0) for actor in world.actors], observation))
    (poses, with_cars), (same, without) = seen
    assert poses == same
    # One of the two cars stands behind the other.
    assert np.sum(with_cars["detections"][:, 0] >= 0) == 1
    assert np.sum(without["detections"][:, 0] >= 0) == 0


def test_a_speed_without_a_turn_is_refused_when_the_environment_is_made():
    with pytest.raises(care_sim.InvalidInput, match="speed_kph of CPTAfo-50 must be one of"):
        make(test="CPTAfo-50")


def test_a_vector_gives_the_same_episode_of_a_turn_and_begins_another_after_its_end():
    turn = {"test": "CPTAno-50", "speed_kph": 10.0, "budget": 0.03, "duration_s": 0.5}
    play = np.zeros((2, 32, 512), np.float32)
    with make(**turn) as env:
        alone = [env.reset(seed=5)[0], *(env.step(NOTHING)[0] for _ in range(5))]
    vector = gymnasium.make_vec("CARE-NCAP-v0", 2, "sync", **turn)
    together = [vector.reset(seed=[5, 6])[0], *(vector.step(play)[0] for _ in range(5))]
    again = vector.step(play)[0]
    vector.close()
    for one, both in zip(alone, together, strict=True):
        assert all(np.array_equal(one[key], both[key][0]) for key in one)
    assert np.count_nonzero(again["ranges"]) == 0
