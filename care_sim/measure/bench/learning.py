"""Environment steps per second inside a learner: how long training takes."""

import time
from dataclasses import replace

from care_sim.base.errors import MissingExtra
from care_sim.base.extras import import_torch
from care_sim.measure.bench.batches import WORLDS, Figures
from care_sim.measure.bench.config import BenchConfig
from care_sim.study.executors import processes
from care_sim.training.algorithms import algorithm, make_learner
from care_sim.training.config import PpoConfig
from care_sim.training.environments import side_by_side

RECIPE = PpoConfig(budget=(0.03, 0.05, 0.1, 0.2, 0.35))
"""How the shipped `ppo-dense` was trained."""
_MANY = replace(RECIPE, environments=WORLDS, rollout=RECIPE.rollout * RECIPE.environments // WORLDS)
"""Many worlds, and as many steps between two updates."""


def _row(recipe: PpoConfig) -> str:
    return f"PPO of Stable-Baselines3, {recipe.environments} worlds of {recipe.env}"


PPO = _row(RECIPE)
ROWS = {
    PPO: (RECIPE, True),
    _row(_MANY): (_MANY, True),
    f"{PPO}, answered at once": (RECIPE, False),
}
"""By row the recipe, and whether the worlds are played. A learner that is answered at once has no
more than its own time: no environment lets it be faster."""


def learning(config: BenchConfig) -> tuple[dict[str, Figures], list[str]]:
    """The `ROWS`: `steps_per_s` of the environments, and `steps_per_cpu_s`, in every round, while
    PPO learns from them; where it is not installed no row, and why in one line.

    A round is whole rollouts with their updates. Not to be called on one core.
    """
    try:
        algorithm(RECIPE.algorithm)
    except MissingExtra as missing:
        return {}, [f"{PPO}: {missing}"]
    # In a process of its own, since PyTorch keeps its threads.
    with processes(1) as pool:
        return {
            name: pool.submit(_learn, recipe, is_played, config).result()
            for name, (recipe, is_played) in ROWS.items()
        }, []


def _learn(recipe: PpoConfig, is_played: bool, config: BenchConfig) -> Figures:
    # Only where there is Stable-Baselines3.
    from care_sim.measure.bench.answered_at_once import AnsweredAtOnce

    import_torch().set_num_threads(recipe.threads)
    envs = side_by_side(recipe)
    figures: Figures = {"steps_per_s": [], "steps_per_cpu_s": []}
    try:
        learner = make_learner(recipe, envs if is_played else AnsweredAtOnce(envs))
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
