"""Steps per second of many worlds at once, on threads, in processes, inside a learner."""

import time
from contextlib import closing
from functools import partial
from itertools import product

import gymnasium
import numpy as np

from care_sim.base.errors import MissingExtra
from care_sim.base.extras import import_torch
from care_sim.certify.design import DRAWN_TEST
from care_sim.core.conditions import KITTI_CAMERA
from care_sim.envs import ENVIRONMENT_IDS
from care_sim.policies import make_policy
from care_sim.study.benchmark.budgets import MAIN_DETECTOR
from care_sim.study.benchmark.suite import LATE
from care_sim.study.executors import processes
from care_sim.training.config import PpoConfig
from care_sim.training.environments import side_by_side
from care_sim.training.run import algorithm, make_learner
from tests.bench.environments import EPISODE, MAIN, TESTS, by_name

WORLDS = 64
THREADS = {1: "one thread", 2: "two threads"}
PROCESSES = f"{WORLDS} worlds, two processes"
"""Half of the worlds in each, with a vector and a policy of its own, on one thread."""
MEASURED = {"budget": 0.01, "detector": MAIN_DETECTOR, "camera_profile": KITTI_CAMERA} | LATE
"""The conditions of the benchmark in the closed loop."""
BENCHMARK = {
    "drives": {"environment": ENVIRONMENT_IDS["drive"]},
    "tests": {"environment": TESTS} | DRAWN_TEST,
}
"""Worlds with the measured camera and detector."""
RECIPE = PpoConfig(budget=(0.03, 0.05, 0.1, 0.2, 0.35))
"""How the shipped `ppo-dense` was trained."""
PPO = f"PPO of Stable-Baselines3, {RECIPE.environments} worlds of {', '.join(RECIPE.env)}"


def row(threads, scoring_info=True):
    """Name of the row of so many threads."""
    told = "" if scoring_info else ", scoring_info=False"
    return f"{WORLDS} worlds, {THREADS[threads]}{told}"


def batches(settings):
    """By row `steps_per_s` of all worlds together, and `steps_per_cpu_s`, steps per second that any
    thread had a core.

    The policy chooses for all worlds, observations are handed out at every step, and episodes that
    are over begin anew. All rows are measured in every round. Not to be called on one core.
    """
    makers = {
        row(n, told): partial(_ours, n, scoring_info=told)
        for told, n in product((True, False), THREADS)
    } | {
        f"{settings.drives} {name} of the benchmark at 1%, two threads": partial(
            _ours, 2, worlds=settings.drives, **MEASURED, **arguments
        )
        for name, arguments in (BENCHMARK.items() if settings.drives else ())
    }
    # Episodes that nobody times: what is compiled late, is compiled in them.
    for make in makers.values():
        speed_of(partial(make, worlds=1), 0.0)
    with processes(2) as pool:
        rounds = [
            {name: speed_of(make, settings.seconds) for name, make in makers.items()}
            | {PROCESSES: speed_of_two(pool, settings.seconds)}
            for _ in range(settings.repeats)
        ]
    return {name: by_name([one[name] for one in rounds]) for name in rounds[0]}


def speed_of(make, seconds):
    """Steps of a vector; `make` gives it and what acts in it."""
    vector, act = make()
    with closing(vector):
        observations, _ = vector.reset(seed=EPISODE.seed)
        started, worked = time.perf_counter(), time.process_time()
        steps = 0
        over, begun = np.zeros((2, vector.num_envs), np.bool_)
        # However short the time, every world begins another episode, at the step after its last:
        # resets are a part of the figure.
        while time.perf_counter() < started + seconds or not begun.all():
            begun |= over
            observations, _, terminated, truncated, _ = vector.step(act(observations))
            over = terminated | truncated
            steps += len(over)
        taken, work = time.perf_counter() - started, time.process_time() - worked
    return {"steps_per_s": steps / taken, "steps_per_cpu_s": steps / work}


def speed_of_two(pool, seconds):
    """Steps of two processes together."""
    halves = [pool.submit(_speed_of_half, seconds) for _ in range(2)]
    first, second = (half.result() for half in halves)
    return {
        "steps_per_s": first["steps_per_s"] + second["steps_per_s"],
        "steps_per_cpu_s": (first["steps_per_cpu_s"] + second["steps_per_cpu_s"]) / 2,
    }


def _speed_of_half(seconds):
    # An episode that nobody times comes first. The same worlds are played by both processes, so
    # that both are timed at the same time but for a moment.
    make = partial(_ours, 1, worlds=WORLDS // 2)
    speed_of(make, 0.0)
    return speed_of(make, seconds)


def _ours(threads, environment=MAIN, worlds=WORLDS, **arguments):
    vector = gymnasium.make_vec(
        f"care_sim:{environment}",
        num_envs=worlds,
        vectorization_mode="vector_entry_point",
        threads=threads,
        copy=False,
        **{"budget": EPISODE.budget} | arguments,
    )
    return vector, make_policy(EPISODE.policy, vector)


def learning(settings):
    """The row `PPO`: steps of the environments, in every round, while PPO learns from them by
    `RECIPE`; where it is not installed no row, and why in one line.

    A round is whole rollouts with their updates. Not to be called on one core.
    """
    try:
        algorithm(RECIPE.algorithm)
    except MissingExtra as missing:
        return {}, [f"{PPO}: {missing}"]
    # In a process of its own, since PyTorch keeps its threads.
    with processes(1) as pool:
        return {PPO: pool.submit(_learn, settings).result()}, []


def _learn(settings):
    import_torch().set_num_threads(RECIPE.threads)
    rounds = []
    with closing(side_by_side(RECIPE)) as envs:
        learner = make_learner(RECIPE, envs)
        # The first rollout warms up.
        learner.learn(1)
        for _ in range(settings.repeats):
            before = learner.num_timesteps
            started, worked = time.perf_counter(), time.process_time()
            while (taken := time.perf_counter() - started) < settings.seconds:
                learner.learn(1, reset_num_timesteps=False)
            steps, work = learner.num_timesteps - before, time.process_time() - worked
            rounds.append({"steps_per_s": steps / taken, "steps_per_cpu_s": steps / work})
    return by_name(rounds)
