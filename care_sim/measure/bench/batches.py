"""Steps per second of many worlds at once, on one thread and on two."""

import time
from contextlib import closing

import gymnasium

from care_sim.envs import ENVIRONMENT_IDS
from care_sim.measure.bench.config import BenchConfig
from care_sim.policies import make_policy
from care_sim.study.episode_play import peak_rss_mb

WORLDS = 64
THREADS = (1, 2)


def batches(config: BenchConfig) -> dict[str, list[float]]:
    """Steps per second over all worlds, in every round, by the number of threads.

    The policy chooses for all, observations are handed out at every step, and episodes that are
    over begin anew. The numbers of threads are measured in turn. Not to be called on one core.
    """
    figures: dict[str, list[float]] = {str(threads): [] for threads in THREADS}
    for _ in range(config.repeats):
        for threads in THREADS:
            figures[str(threads)].append(_steps_per_s(config, threads))
    return figures


def batch_memory(config: BenchConfig) -> dict[str, float]:
    """Peak memory in MB of this process with the worlds of one batch, which begin `resets` episodes
    in all: `begun_mb` after the first of each, `peak_mb` in the end.
    """
    with closing(_vector(config, threads=1)) as vector:
        vector.reset(seed=config.seed)
        begun = peak_rss_mb()
        for number in range(config.resets // WORLDS):
            vector.reset(seed=config.seed + number * WORLDS)
            vector.step(vector.action_space.sample())
    return {"begun_mb": begun, "peak_mb": peak_rss_mb()}


def _vector(config: BenchConfig, threads: int) -> gymnasium.vector.VectorEnv:
    return gymnasium.make_vec(
        f"care_sim:{ENVIRONMENT_IDS[config.scenario]}",
        num_envs=WORLDS,
        vectorization_mode="vector_entry_point",
        threads=threads,
        budget=config.budget,
        copy=False,
    )


def _steps_per_s(config: BenchConfig, threads: int) -> float:
    with closing(_vector(config, threads)) as vector:
        policy = make_policy(config.policy, vector)
        observations, _ = vector.reset(seed=config.seed)
        policy.reset()
        steps = 0
        started = time.perf_counter()
        while (seconds := time.perf_counter() - started) < config.seconds:
            observations, *_ = vector.step(policy(observations))
            steps += WORLDS
    return steps / seconds
