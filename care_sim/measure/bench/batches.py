"""Steps per second and memory of many worlds at once, on threads and in processes."""

import threading
import time
from collections.abc import Callable
from concurrent.futures import Executor
from contextlib import closing
from functools import partial
from itertools import cycle, product
from typing import Any

import gymnasium
import numpy as np

from care_sim.base.errors import MissingExtra
from care_sim.base.extras import import_envpool
from care_sim.core.arrays import Mask
from care_sim.envs import ENVIRONMENT_IDS
from care_sim.envs.wrappers.vectors import AnyVector
from care_sim.measure.bench.config import BenchConfig
from care_sim.policies import make_policy
from care_sim.study.episode_play import peak_rss_mb
from care_sim.study.executors import processes

WORLDS = 64
_THREADS = {1: "one thread", 2: "two threads"}

PROCESSES = f"{WORLDS} worlds, two processes"
"""Half of the worlds in each, with a vector and a policy of its own, on one thread."""

ENVPOOL = "EnvPool HighwayFast-v0"
ENVPOOL_CONTAINS = (
    f"{ENVPOOL}: highway-env's driving in C++, 20 vehicles in three lanes, five of them told as "
    "numbers; a step is a second of 5 world steps; no LiDAR, no camera, no tracker, no policy"
)

Figures = dict[str, list[float]]
"""A figure of every round, by name."""


def row(threads: int, scoring_info: bool = True) -> str:
    """Name of the row of so many threads."""
    return f"{WORLDS} worlds, {_THREADS[threads]}" + (
        "" if scoring_info else ", scoring_info=False"
    )


def batches(config: BenchConfig) -> tuple[dict[str, Figures], list[str]]:
    """By row `steps_per_s` of all worlds together, and `steps_per_cpu_s`, steps per second that any
    thread had a core; and in one line each what is left out.

    The policy chooses for all worlds, observations are handed out at every step, and episodes that
    are over begin anew. All rows are measured in every round. Not to be called on one core.
    """
    makers, skipped = _makers(config)
    # An episode that nobody times: what is compiled late, is compiled in it.
    for scoring_info in (True, False):
        _speed(partial(_playing, config, 1, scoring_info, worlds=2), 0.0)
    with processes(2) as pool:
        rounds = [
            {name: _speed(make, config.seconds) for name, make in makers.items()}
            | {PROCESSES: _speed_of_two(pool, config)}
            for _ in range(config.repeats)
        ]
    return {
        name: {figure: [one[name][figure] for one in rounds] for figure in first}
        for name, first in rounds[0].items()
    }, skipped


def batch_memory(config: BenchConfig) -> dict[str, float]:
    """Peak memory in MB of a process that plays one batch on two threads, with its policy.

    `begun_mb` when every world has begun an episode, `early_mb` after a tenth of the `resets`,
    `peak_mb` after all; `threads_left` is how many threads are there still when the environment is
    closed. A step follows every reset.
    """
    with processes(1) as pool:
        return pool.submit(_resets, config).result()


def _resets(config: BenchConfig) -> dict[str, float]:
    threads = threading.active_count()
    rounds = -(-config.resets // WORLDS)
    memory = {"resets": float(rounds * WORLDS)}
    with closing(_vector(config, threads=2)) as vector:
        policy = make_policy(config.policy, vector)
        for number in range(rounds):
            observations, _ = vector.reset(seed=config.seed + number * WORLDS)
            policy.reset()
            vector.step(policy(observations))
            if number == 0:
                memory["begun_mb"] = peak_rss_mb()
            if number == rounds // 10:
                memory["early_mb"] = peak_rss_mb()
    left = float(threading.active_count() - threads)
    return {**memory, "peak_mb": peak_rss_mb(), "threads_left": left}


class _Playing:
    """A vector environment that was reset, and what acts in it."""

    def __init__(self, vector: AnyVector, act: Callable[[Any], Any], seed: int | None = None):
        self.vector = vector
        self._act = act
        self._observations, _ = vector.reset(seed=seed)

    def step(self) -> Mask:
        """One step of all worlds; (W,) whose episode is over."""
        actions = self._act(self._observations)
        self._observations, _, terminated, truncated, _ = self.vector.step(actions)
        over: Mask = terminated | truncated
        return over


def _makers(config: BenchConfig) -> tuple[dict[str, Callable[[], _Playing]], list[str]]:
    makers: dict[str, Callable[[], _Playing]] = {
        row(threads, scoring_info): partial(_playing, config, threads, scoring_info)
        for scoring_info, threads in product((True, False), _THREADS)
    }
    try:
        import_envpool()
    except MissingExtra as missing:
        return makers, [f"{ENVPOOL}: {missing}"]
    return {**makers, ENVPOOL: partial(_envpool, config)}, []


def _playing(
    config: BenchConfig, threads: int, scoring_info: bool = True, worlds: int = WORLDS
) -> _Playing:
    vector = _vector(config, threads, scoring_info, worlds)
    policy = make_policy(config.policy, vector)
    return _Playing(vector, policy, config.seed)


def _envpool(config: BenchConfig) -> _Playing:
    vector = import_envpool().make_gymnasium(
        "HighwayFast-v0", num_envs=WORLDS, num_threads=2, seed=config.seed
    )
    # Drawn beforehand: the time of drawing is not that of the environment.
    choices = vector.single_action_space.n
    rng = np.random.default_rng(config.seed)
    drawn = cycle(rng.integers(choices, size=(1000, WORLDS), dtype=np.int32))
    return _Playing(vector, lambda _observations: next(drawn))


def _vector(
    config: BenchConfig, threads: int, scoring_info: bool = True, worlds: int = WORLDS
) -> AnyVector:
    return gymnasium.make_vec(
        f"care_sim:{ENVIRONMENT_IDS[config.scenario]}",
        num_envs=worlds,
        vectorization_mode="vector_entry_point",
        threads=threads,
        budget=config.budget,
        scoring_info=scoring_info,
        copy=False,
    )


def _speed(make: Callable[[], _Playing], seconds: float) -> dict[str, float]:
    playing = make()
    with closing(playing.vector):
        started, worked = time.perf_counter(), time.process_time()
        steps = 0
        over, begun = np.zeros((2, playing.vector.num_envs), np.bool_)
        # However short the time, every world begins another episode, at the step after its last:
        # resets are a part of the figure, and worlds that began together are over together.
        while time.perf_counter() < started + seconds or not begun.all():
            begun |= over
            over = playing.step()
            steps += len(over)
        taken, work = time.perf_counter() - started, time.process_time() - worked
    return {"steps_per_s": steps / taken, "steps_per_cpu_s": steps / work}


def _speed_of_two(pool: Executor, config: BenchConfig) -> dict[str, float]:
    halves = [pool.submit(_speed_of_half, config) for _ in range(2)]
    first, second = (half.result() for half in halves)
    return {
        "steps_per_s": first["steps_per_s"] + second["steps_per_s"],
        "steps_per_cpu_s": (first["steps_per_cpu_s"] + second["steps_per_cpu_s"]) / 2,
    }


def _speed_of_half(config: BenchConfig) -> dict[str, float]:
    # An episode that nobody times: what is compiled or loaded late, is loaded in it. The same
    # worlds are played by both, so that both are timed at the same time but for a moment.
    make = partial(_playing, config, 1, worlds=WORLDS // 2)
    _speed(make, 0.0)
    return _speed(make, config.seconds)
