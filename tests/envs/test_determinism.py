"""The same seed gives the same episode to the last bit: in one process, in many, in vectors."""

import hashlib
import os
import subprocess
import sys

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.envs import CLOSED_LOOP
from tests.helpers.places import ROOT

NAME = "care_sim:CARE-Dense-v0"
SEED = 11
STEPS = 8
every_world = pytest.mark.parametrize("name", CLOSED_LOOP)


def digest(observations):
    total = hashlib.sha256()
    for observation in observations:
        for key in sorted(observation):
            total.update(np.ascontiguousarray(observation[key]).tobytes())
    return total.hexdigest()


def actions():
    rng = np.random.default_rng(0)
    return [rng.random((32, 512), dtype=np.float32) for _ in range(STEPS)]


def alone(name=NAME):
    env = gymnasium.make(name, disable_env_checker=True)
    observations = [env.reset(seed=SEED)[0]]
    observations += [env.step(action)[0] for action in actions()]
    env.close()
    return digest(observations)


def in_a_vector(vector):
    observations = [vector.reset(seed=[SEED, SEED + 1])[0]]
    observations += [vector.step(np.stack([action, action]))[0] for action in actions()]
    observations = [
        {key: value[0].copy() for key, value in observation.items()} for observation in observations
    ]
    vector.close()
    return digest(observations)


@every_world
@pytest.mark.parametrize("mode", ["sync", "async"])
def test_vectors_of_gymnasium_give_the_same_episode(name, mode):
    # One of them in interpreters of their own; the others are forked, which takes no time.
    context = {"context": "spawn" if name in NAME else "fork"}
    kwargs = {} if mode == "sync" else context
    vector = gymnasium.make_vec(name, num_envs=2, vectorization_mode=mode, vector_kwargs=kwargs)
    assert in_a_vector(vector) == alone(name)


def test_another_process_with_another_hash_seed_gives_the_same_episodes():
    program = (
        "from tests.envs.test_determinism import CLOSED_LOOP, alone; "
        "print(*(alone(name) for name in CLOSED_LOOP))"
    )
    other = "1" if os.environ.get("PYTHONHASHSEED") != "1" else "2"
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=ROOT,
        env=os.environ | {"PYTHONHASHSEED": other},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split()[-len(CLOSED_LOOP) :] == [alone(name) for name in CLOSED_LOOP]


@pytest.mark.slow
def test_the_subprocess_vector_of_stable_baselines3_gives_the_same_episode():
    vec_env = pytest.importorskip("stable_baselines3.common.vec_env")
    vector = vec_env.SubprocVecEnv([make_one], start_method="spawn")
    vector.seed(SEED)
    observations = [vector.reset()]
    observations += [vector.step(action[None])[0] for action in actions()]
    vector.close()
    assert (
        digest([{key: value[0] for key, value in seen.items()} for seen in observations]) == alone()
    )


def make_one():
    return gymnasium.make(NAME, disable_env_checker=True)


@every_world
def test_the_policy_loop_repeats_and_another_seed_differs(name):
    digests = []
    for seed in (SEED, SEED, SEED + 1):
        env = gymnasium.make(name, disable_env_checker=True)
        policy = care_sim.make_policy("care", env)
        observations = [env.reset(seed=seed)[0]]
        for _ in range(STEPS):
            observations.append(env.step(policy(observations[-1]))[0])
        digests.append(digest(observations))
        env.close()
    assert digests[0] == digests[1] != digests[2]


def test_reset_without_a_seed_goes_on_in_the_stream_of_the_last_one():
    env = gymnasium.make(NAME, disable_env_checker=True)
    env.reset(seed=1)
    second, third = env.reset()[1]["seed"], env.reset()[1]["seed"]
    env.reset(seed=1)
    assert (env.reset()[1]["seed"], env.reset()[1]["seed"]) == (second, third)
    assert second != third
    env.close()
