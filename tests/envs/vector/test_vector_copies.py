"""A vector and its policy that are copied or pickled in mid-episode play on as if alone."""

import copy
import pickle

import pytest

import care_sim
from care_sim.envs import CLOSED_LOOP
from tests.envs.vector.test_same_episodes import (
    CONDITIONS,
    OWN_BUDGETS,
    OWN_FAULTS,
    SLOW_CONDITIONS,
)
from tests.helpers.vectors import difference, native

CASES = {
    "plain": {},
    **CONDITIONS,
    "own": OWN_BUDGETS | OWN_FAULTS,
}


def play(env, policy, observation, steps):
    """Play so many steps. Return the last observation, and all that the steps gave."""
    given = []
    for _ in range(steps):
        given.append(env.step(policy(observation)))
        observation = given[-1][0]
    return observation, dict(enumerate(dict(enumerate(each)) for each in copy.deepcopy(given)))


def plays_on(name, steps, **arguments):
    """Return where two copies and their original first differ from a vector that nobody copied."""
    found = []
    for copies in (False, True):
        env = native(name, 3, threads=2, **{"budget": 0.03} | arguments)
        policy = care_sim.make_policy("care", env)
        middle, _ = play(env, policy, env.reset(seed=3)[0], steps // 3)
        both = env, policy
        takes = (copy.deepcopy(both), pickle.loads(pickle.dumps(both))) if copies else ()
        for one in (*takes, both):
            found.append(play(*one, middle, steps - steps // 3)[1])
            one[0].close()
    return [difference(one, found[0]) for one in found[1:]]


@pytest.mark.parametrize("name", CLOSED_LOOP)
def test_every_environment(name):
    # Episodes begin anew, with seeds that the worlds draw.
    steps = 9 if name == "CARE-Drive-v0" else 66
    assert plays_on(name, steps, autoreset_mode="SameStep") == [None] * 3


@pytest.mark.parametrize("name", CASES)
def test_conditions(name):
    steps = 6 if name in SLOW_CONDITIONS else 33
    assert plays_on("CARE-Dense-v0", steps, **{"duration_s": 2.0} | CASES[name]) == [None] * 3
