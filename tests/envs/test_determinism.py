"""The same seed gives the same episode to the last bit: in one process, in many, in vectors."""

import hashlib
import os
import subprocess
import sys

import gymnasium
import numpy as np
import pytest

from care_sim.envs import CLOSED_LOOP
from tests.helpers.places import ROOT

NAME = "care_sim:CARE-Dense-v0"
SEED = 11
STEPS = 8


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


@pytest.mark.parametrize("mode", ["sync", "async"])
def test_vectors_of_gymnasium_give_the_same_episode(mode):
    kwargs = {} if mode == "sync" else {"context": "spawn"}
    vector = gymnasium.make_vec(NAME, num_envs=2, vectorization_mode=mode, vector_kwargs=kwargs)
    assert in_a_vector(vector) == alone()


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


def test_reset_without_a_seed_goes_on_in_the_stream_of_the_last_one():
    env = gymnasium.make(NAME, disable_env_checker=True)
    env.reset(seed=1)
    second, third = env.reset()[1]["seed"], env.reset()[1]["seed"]
    env.reset(seed=1)
    assert (env.reset()[1]["seed"], env.reset()[1]["seed"]) == (second, third)
    assert second != third
    env.close()
