"""Steps and constructions per second of the environments, and of known ones beside them; memory of
a worker, steps of two processes, time of a study.
"""

import time
from contextlib import ExitStack
from functools import partial

import gymnasium
from gymnasium import spaces
from gymnasium.utils.performance import benchmark_init, benchmark_step, benchmark_vector_step
from gymnasium.vector import AsyncVectorEnv

from care_sim.base.extras import silenced
from care_sim.base.processes import following, starting
from care_sim.core.conditions import DEFAULTS
from care_sim.envs import ENVIRONMENT_IDS
from care_sim.sensors.engines import ENGINES
from care_sim.study.designs.paper import paper_study
from care_sim.study.episode_play import peak_rss_mb
from care_sim.study.episodes_together import MOST_TOGETHER, play_episodes
from care_sim.study.executors import processes
from care_sim.study.run_config import in_batches
from tests.bench.settings import EPISODE, MAIN

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
    with silenced(STANDARD_OUTPUT):
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


def worker_memory(settings):
    """Peak memory in MB of a worker that begins `resets` episodes; see `grown_memory`."""
    with processes(1) as pool:
        return pool.submit(_worker_resets, settings.resets).result()


def _worker_resets(resets):
    with driven() as env:

        def begin(number):
            env.reset(seed=EPISODE.seed + number)
            env.step(0)

        return {"resets": float(resets)} | grown_memory(begin, resets)


def grown_memory(begin, times):
    """Peak memory in MB of this process: `begun_mb` when `begin` was called once, `early_mb` after
    a tenth of the times, `peak_mb` after all.
    """
    memory = {}
    for number in range(times):
        begin(number)
        if number == 0:
            memory["begun_mb"] = peak_rss_mb()
        if number == times // 10:
            memory["early_mb"] = peak_rss_mb()
    return {**memory, "peak_mb": peak_rss_mb()}


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


def study(settings):
    """The paper's closed-loop study: its `episodes`, and the `seconds` two workers take from their
    start to the last row. Raises RuntimeError when an episode fails.
    """
    configs = paper_study(range(settings.seeds))
    started = time.perf_counter()
    with processes(2) as pool:
        batches = pool.map(play_episodes, in_batches(configs, MOST_TOGETHER))
        answers = [answer for batch in batches for answer in batch]
    seconds = time.perf_counter() - started
    for failed in (answer for answer in answers if isinstance(answer, str)):
        raise RuntimeError(failed)
    return {"episodes": float(len(answers)), "seconds": seconds}
