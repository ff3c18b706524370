"""The environment of the Euro NCAP tests, with its real parts."""

import gymnasium
import numpy as np
import pytest

from care_sim.scenarios.ncap.table import TESTS
from tests.helpers.episodes import played

NOTHING = np.zeros((32, 512), np.float32)


def make(**arguments):
    return gymnasium.make("CARE-NCAP-v0", disable_env_checker=True, **arguments)


def ended(policy, **arguments):
    """The outcome of an episode, its keyframes, and whether it was terminated."""
    with make(budget=1.0 if policy == "full" else 0.03, **arguments) as env:
        *_, (_, _, terminated, _, info) = steps = played(env, policy)
    return info["outcome"], len(steps) - 1, terminated


@pytest.mark.parametrize("name", ["CPNCO-50", "CPTAns-50", "CCRb"])
def test_the_full_scan_avoids_the_slowest_test(name):
    speeds = TESTS[name].variations[0]
    came_of, steps, terminated = ended(
        "full", test=name, speed_kph=speeds.ego_kph, target_kph=speeds.target_kph
    )
    assert not came_of["collision"]
    assert came_of["braked"]
    assert terminated
    assert steps < 100


def test_a_car_that_sees_nothing_hits():
    came_of, steps, terminated = ended(None, floor=False)
    assert came_of["impact_speed_mps"] == pytest.approx(41 / 3.6, abs=1 / 3.6)
    assert terminated
    assert steps in (40, 41)


def test_its_worlds_ask_for_foresight_themselves():
    """The left turn before an oncoming car, which a brake without it does not avoid."""
    turn = {"test": "CCFtap", "speed_kph": 10.0, "target_kph": 30.0}
    usual = ended("full", **turn)
    assert usual == ended("full", brake_for_oncoming=True, **turn)
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
    # Given parameters are not listed as drawn, and drawn ones are not shown without scoring
    # information.
    assert told == {"seed": 4}
    with make(budget=0.03, test="drawn", speed_kph=0, scoring_info=False) as env:
        assert env.reset(seed=4)[1] == {}
