"""Environment steps per second inside a learner: how long training takes."""

import time

from care_sim.base.errors import MissingExtra
from care_sim.base.extras import import_torch
from care_sim.measure.bench.batches import Figures
from care_sim.measure.bench.config import BenchConfig
from care_sim.study.executors import processes
from care_sim.training.algorithms import algorithm, make_learner
from care_sim.training.config import PpoConfig
from care_sim.training.environments import side_by_side

RECIPE = PpoConfig(budget=(0.03, 0.05, 0.1, 0.2, 0.35))
"""How the shipped `ppo-dense` was trained."""
PPO = f"PPO of Stable-Baselines3, {RECIPE.environments} worlds of {', '.join(RECIPE.env)}"
ANSWERED_AT_ONCE = f"{PPO}, answered at once"
"""The same learner when it waits for no environment: none lets it be faster."""


def learning(config: BenchConfig) -> tuple[dict[str, Figures], list[str]]:
    """The rows `PPO` and `ANSWERED_AT_ONCE`: `steps_per_s` of the environments, and
    `steps_per_cpu_s`, in every round, while PPO learns from them by `RECIPE`; where it is not
    installed no row, and why in one line.

    A round is whole rollouts with their updates. Not to be called on one core.
    """
    try:
        algorithm(RECIPE.algorithm)
    except MissingExtra as missing:
        return {}, [f"{PPO}: {missing}"]
    # In a process of its own, since PyTorch keeps its threads.
    with processes(1) as pool:
        return {
            name: pool.submit(_learn, is_played, config).result()
            for name, is_played in ((PPO, True), (ANSWERED_AT_ONCE, False))
        }, []


def _learn(is_played: bool, config: BenchConfig) -> Figures:
    # Only where there is Stable-Baselines3.
    from care_sim.measure.bench.answered_at_once import AnsweredAtOnce

    import_torch().set_num_threads(RECIPE.threads)
    envs = side_by_side(RECIPE)
    figures: Figures = {"steps_per_s": [], "steps_per_cpu_s": []}
    try:
        learner = make_learner(RECIPE, envs if is_played else AnsweredAtOnce(envs))
        # The first rollout warms up.
        learner.learn(1)
        for _ in range(config.repeats):
            before = learner.num_timesteps
            started, worked = time.perf_counter(), time.process_time()
            while (taken := time.perf_counter() - started) < config.seconds:
                learner.learn(1, reset_num_timesteps=False)
            steps = learner.num_timesteps - before
            figures["steps_per_s"].append(steps / taken)
            figures["steps_per_cpu_s"].append(steps / (time.process_time() - worked))
    finally:
        envs.close()
    return figures
