"""Environments made and left by the hundred, closed or not, leave nothing behind.

`CARE_SIM_CYCLES=20000 pytest tests/envs/test_leaks.py` is the long form.
"""

import gc
import os
import threading
from pathlib import Path

import gymnasium
import numpy as np
import pytest

from care_sim.base.errors import BrokenScenario
from care_sim.envs import CLOSED_LOOP
from care_sim.scenarios.dartout import Dartout
from care_sim.world.bullet_bodies import MOST_FREE, pybullet

CYCLES = int(os.environ.get("CARE_SIM_CYCLES", "60"))
MOST_CLIENTS = 1024
GROWTH_MB = 20.0
"""A client holds 28 MB; the rest is the allocator's own unrest."""


def without_furniture(_scenario, _world, _crossing_x, _rng):
    """Something goes wrong once the world is there."""
    raise RuntimeError("no furniture")


def made(name="CARE-Dartout-v0", **conditions):
    return gymnasium.make(name, disable_env_checker=True, budget=0.01, **conditions)


def closed(seed):
    env = made()
    env.reset(seed=seed)
    env.step(np.zeros((32, 512), np.float32))
    env.close()


def dropped(seed, name="CARE-Dartout-v0", **conditions):
    env = made(name, **conditions)
    env.reset(seed=seed)
    env.step(np.zeros((32, 512), np.float32))


def reset_twice(seed):
    env = made()
    env.reset(seed=seed)
    env.reset(seed=seed + 1)


def failed(seed):
    env = made().unwrapped
    env.reset(seed=seed)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Dartout, "furnish", without_furniture)
        with pytest.raises(BrokenScenario, match="no furniture"):
            env.reset(seed=seed)


def vector_dropped(seed):
    envs = gymnasium.make_vec("CARE-Dartout-v0", num_envs=3, vectorization_mode="sync", budget=0.01)
    envs.reset(seed=seed)


def held():
    """Resident memory (MB), open files, threads of Python and of the system, PyBullet clients."""
    gc.collect()
    lines = Path("/proc/self/status").read_text().splitlines()
    memory = next(int(line.split()[1]) for line in lines if line.startswith("VmRSS:")) / 1024
    files, tasks = (len(os.listdir(f"/proc/self/{kind}")) for kind in ("fd", "task"))
    return memory, files, threading.active_count(), tasks, clients()


def clients():
    return sum(map(pybullet.isConnected, range(MOST_CLIENTS)))


WAYS = [closed, dropped, reset_twice, failed, vector_dropped]


def is_flat(way, cycles, growth_mb=GROWTH_MB):
    for seed in range(MOST_FREE):
        way(seed)
    memory, *before = held()
    for seed in range(cycles):
        way(seed)
    later, *after = held()
    assert after == before
    assert later - memory < growth_mb


@pytest.mark.parametrize("way", WAYS)
def test_memory_files_threads_and_clients_stay_flat(way):
    is_flat(way, CYCLES if way is not vector_dropped else CYCLES // 3)


@pytest.mark.parametrize(
    ("name", "conditions"),
    [
        *((name, {}) for name in CLOSED_LOOP),
        ("CARE-Dartout-v0", {"lidar_sweep_s": 0.1, "lidar_divergence_mrad": 3.0}),
    ],
)
def test_a_dropped_environment_leaves_its_client_at_once_without_the_garbage_collector(
    name, conditions
):
    gc.collect()
    before = clients()
    gc.disable()
    try:
        for seed in range(MOST_FREE + 2):
            dropped(seed, name, **conditions)
        assert clients() <= before + 1
    finally:
        gc.enable()
