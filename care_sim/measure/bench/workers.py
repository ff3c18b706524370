"""What worker processes cost: memory of one, steps of two side by side, time of a whole study."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import cast

from gymnasium.utils.performance import benchmark_vector_step
from gymnasium.vector import AsyncVectorEnv

from care_sim.base.processes import following, starting
from care_sim.measure.bench.config import BenchConfig
from care_sim.measure.driven import driven
from care_sim.study.designs.paper import paper_study
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.episode_play import peak_rss_mb
from care_sim.study.episodes_together import MOST_TOGETHER, play_episodes
from care_sim.study.executors import processes
from care_sim.study.run_config import in_batches

_Memory = dict[str, float]

_PROCESSES = (1, 2)
_STUDY_WORKERS = 2


def worker_memory(config: BenchConfig) -> _Memory:
    """Peak memory in MB of a worker of the studies, which begins episode after episode.

    `begun_mb` when it has begun one, `early_mb` after a tenth of the resets, `peak_mb` after all of
    them; `resets` is their number. A step follows every reset.
    """
    with processes(1) as pool:
        return pool.submit(_resets, config.episode, config.resets).result()


def _resets(config: EpisodeConfig, resets: int) -> _Memory:
    memory = {"resets": float(resets)}
    with driven(config) as env:
        for number in range(resets):
            env.reset(seed=config.seed + number)
            env.step(0)
            if number == 0:
                memory["begun_mb"] = peak_rss_mb()
            if number == resets // 10:
                memory["early_mb"] = peak_rss_mb()
    return {**memory, "peak_mb": peak_rss_mb()}


def vectorised(config: BenchConfig) -> dict[str, list[float]]:
    """Steps per second, in every round, of one and of two processes that each hold an environment
    and its policy.

    The two are measured in turn; those not measured wait. Not to be called on one core.
    """
    figures: dict[str, list[float]] = {str(number): [] for number in _PROCESSES}
    for _ in range(config.repeats):
        for number in _PROCESSES:
            with _vector(config, number) as envs:
                steps = benchmark_vector_step(envs, cast("int", config.seconds), config.seed)
            figures[str(number)].append(steps)
    return figures


@contextmanager
def _vector(config: BenchConfig, number: int) -> Iterator[AsyncVectorEnv]:
    make = partial(following, partial(driven, config.episode))
    with starting():
        envs = AsyncVectorEnv([make] * number, context="spawn")
    try:
        yield envs
    finally:
        envs.close()


def study(seeds: int) -> dict[str, float]:
    """The paper's closed-loop study: `episodes` of that many seeds, and the `seconds` two workers
    take from their start to the last row. Raises RuntimeError when an episode fails.
    """
    configs = paper_study(range(seeds))
    started = time.perf_counter()
    with processes(_STUDY_WORKERS) as pool:
        answers = [
            answer
            for batch in pool.map(play_episodes, in_batches(configs, MOST_TOGETHER))
            for answer in batch
        ]
    seconds = time.perf_counter() - started
    for failed in (answer for answer in answers if isinstance(answer, str)):
        raise RuntimeError(failed)
    return {"episodes": float(len(answers)), "seconds": seconds}
