"""Environments made and left by the hundred, closed or not, leave nothing behind.

`CARE_SIM_CYCLES=20000 pytest tests/envs/test_leaks.py` is the long form.
"""

import gc
import os
import threading
from dataclasses import dataclass
from pathlib import Path

import gymnasium
import numpy as np
import pytest

from care_sim.base.errors import BrokenScenario
from care_sim.envs import CLOSED_LOOP
from care_sim.scenarios.dartout import Dartout
from care_sim.world.bullet_bodies import MOST_FREE, pybullet
from care_sim.world.contact import judge_here

CYCLES = int(os.environ.get("CARE_SIM_CYCLES", "150"))
MOST_CLIENTS = 1024
GROWTH_MB = 20.0
"""A client holds 28 MB; the rest is the allocator's own unrest."""
MIXED_GROWTH_MB = 10.0
"""Half of that where two ways share the cycles: so it shows a leak of one of them as small, 20 kB
per cycle. A thousand cycles without a leak grew by 0.4 MB at most."""


@dataclass(frozen=True)
class Broken(Dartout):
    """A street in which something goes wrong once the world is there."""

    def furnish(self, world, crossing_x, rng):
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
    env.scenario = Broken()
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


def closed_or_dropped(seed):
    (dropped if seed % 2 else closed)(seed)


@pytest.mark.slow
def test_they_stay_flat_over_a_thousand():
    is_flat(closed_or_dropped, max(CYCLES, 1000), MIXED_GROWTH_MB)


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


def test_many_at_a_time_leave_few_clients_behind():
    envs = [made() for _ in range(2 * MOST_FREE)]
    before = clients()
    for env in envs:
        env.reset(seed=0)
    # A world asks for a client of its own when it is drawn, or looked at with Bullet's rays.
    assert clients() <= before + 1
    for env in envs:
        env.unwrapped.loop.world.bullet.cast(np.zeros(3), np.array([[1.0, 0.0, 0.0]]), 10.0)
    assert clients() > before
    for env in envs:
        env.close()
    # The judge of clearances keeps its client as long as its thread, unless it is closed.
    judge_here().close()
    assert clients() <= max(before, MOST_FREE)


def test_what_was_dropped_in_the_middle_of_another_is_not_its_client():
    """Somebody else's last reference may go at any moment."""
    first, second = made(), made()
    first.reset(seed=0)
    second.reset(seed=1)
    del first
    third = made()
    third.reset(seed=0)
    action = np.ones((32, 512), np.float32)
    stepped = second.step(action)[0]["ranges"]
    second.reset(seed=1)
    np.testing.assert_array_equal(second.step(action)[0]["ranges"], stepped)
    second.close()
    third.close()
