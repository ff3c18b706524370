"""The measurements and their lengths: steps and constructions per second of the environments, and
of known ones beside them; steps of two processes.
"""

import time
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils.performance import benchmark_init, benchmark_step, benchmark_vector_step
from gymnasium.vector import AsyncVectorEnv

from care_sim.base.extras import silence_output
from care_sim.base.processes import following, starting
from care_sim.core.conditions import DEFAULTS
from care_sim.envs import ENVIRONMENT_IDS
from care_sim.sensors.engines import ENGINES
from care_sim.study.episode_config import EpisodeConfig

EPISODE = EpisodeConfig("dense", "care", 0.1, 0)
"""The episode that is played unless a row says otherwise; its seed is that of all scenes."""
MAIN = ENVIRONMENT_IDS[EPISODE.scenario]
STANDARD_OUTPUT = 1
DRIVING = "highway-fast-v0"
REACHING = "PandaReach-v3"
"""Known environments, under random actions: highway-env's driving without sensors, and panda-gym's
arm, also over PyBullet.
"""
DRIVE = "CARE-Drive-v0 at 3%"
"""A row of its own: the longest episodes, with six cameras, at a budget that is published."""
TESTS = ENVIRONMENT_IDS["ncap"]
"""The shortest episodes, of which a study plays the most."""


@dataclass(frozen=True)
class Settings:
    """`seconds` of every single measurement of steps; `repeats`, rounds in each of which everything
    is measured once; `samples`, scans per engine and choices per round; `drives`, worlds of each
    row of the benchmark, which take minutes.
    """

    seconds: float = 3.0
    repeats: int = 3
    samples: int = 200
    drives: int = 64


def middle(values):
    """The median."""
    return float(np.median(values))


def by_name(rounds):
    """Figures of several rounds, round by round under each name."""
    return {name: [figures[name] for figures in rounds] for name in rounds[0]}


class Driven(gymnasium.Wrapper):
    """An environment that a policy steers, whatever the action."""

    def __init__(self, env, policy):
        super().__init__(env)
        # Gymnasium's measures draw an action for every step: to draw scores of 16,384 cells would
        # count as time of the environment.
        self.action_space = spaces.Discrete(1)
        self.policy = policy

    def reset(self, *, seed=None, options=None):
        self.policy.reset()
        self._observation, info = self.env.reset(seed=seed, options=options)
        return self._observation, info

    def step(self, action):
        result = self.env.step(self.policy(self._observation))
        self._observation = result[0]
        return result


def driven(config=EPISODE):
    """The environment of an episode, steered by its policy."""
    env = config.make_env()
    return Driven(env, config.make_policy(env))


def makers():
    """Makers of all that is measured, the main environment first, and in one line each what is left
    out.
    """
    changes = {MAIN: {}}
    changes |= {
        f"{MAIN}, engine {name}": {"engine": name} for name in ENGINES if name != DEFAULTS["engine"]
    }
    changes |= {
        ENVIRONMENT_IDS[name]: {"scenario": name}
        for name in ENVIRONMENT_IDS
        if name != EPISODE.scenario
    }
    changes[DRIVE] = {"scenario": "drive", "budget": 0.03}
    made = {name: partial(driven, EPISODE.changed(**own)) for name, own in changes.items()}
    made[DRIVING] = partial(gymnasium.make, f"highway_env:{DRIVING}", disable_env_checker=True)
    try:
        import panda_gym  # noqa: F401 (registers its environments)
    except ImportError as error:
        return made, [f"{REACHING}: {error}"]
    return {**made, REACHING: partial(gymnasium.make, REACHING, disable_env_checker=True)}, []


def speed(maker, settings):
    """Figures of one environment: `steps_per_s`, resets included; `steps_per_cpu_s`, steps per
    second that this process itself had the core; `inits_per_s`, constructions with a reset.
    """
    with silence_output(STANDARD_OUTPUT):
        with maker() as env:
            started, worked = time.perf_counter(), time.process_time()
            steps = benchmark_step(env, settings.seconds, EPISODE.seed)
            share = (time.process_time() - worked) / (time.perf_counter() - started)
        with ExitStack() as made:
            one_at_a_time = partial(_replaced, maker, made)
            inits = benchmark_init(one_at_a_time, settings.seconds, EPISODE.seed)
    return {"steps_per_s": steps, "steps_per_cpu_s": steps / share, "inits_per_s": inits}


def _replaced(maker, made):
    """A new environment in the place of the one before, which `benchmark_init` leaves open."""
    made.close()
    return made.enter_context(maker())


def vectorised(settings):
    """Steps per second, in every round, of one and of two processes that each hold an environment
    and its policy. Not to be called on one core.
    """
    figures = {"1": [], "2": []}
    for _ in range(settings.repeats):
        for number, told in figures.items():
            with starting():
                made = [partial(following, driven)] * int(number)
                envs = AsyncVectorEnv(made, context="spawn")
            try:
                told.append(benchmark_vector_step(envs, settings.seconds, EPISODE.seed))
            finally:
                envs.close()
    return figures
