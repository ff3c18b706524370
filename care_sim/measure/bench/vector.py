"""Steps per second of vectorised environments: two processes against one."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import cast

from gymnasium.utils.performance import benchmark_vector_step
from gymnasium.vector import AsyncVectorEnv

from care_sim.base.processes import following, starting
from care_sim.measure.bench.config import BenchConfig
from care_sim.measure.bench.driven import driven

PROCESSES = (1, 2)


def vectorised(config: BenchConfig) -> dict[str, list[float]]:
    """Steps per second, in every round, of one and of two processes that each hold an environment
    and its policy.

    The two are measured in turn; those not measured wait. Not to be called on one core.
    """
    figures: dict[str, list[float]] = {str(number): [] for number in PROCESSES}
    for _ in range(config.repeats):
        for number in PROCESSES:
            with _workers(config, number) as envs:
                figures[str(number)].append(
                    benchmark_vector_step(envs, cast("int", config.seconds), config.seed)
                )
    return figures


@contextmanager
def _workers(config: BenchConfig, number: int) -> Iterator[AsyncVectorEnv]:
    make = partial(following, partial(driven, config.episode))
    with starting():
        envs = AsyncVectorEnv([make] * number, context="spawn")
    try:
        yield envs
    finally:
        envs.close()
