"""Steps and constructions per second of the environments, and of known ones beside them."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from typing import cast

import gymnasium
from gymnasium.utils.performance import benchmark_init, benchmark_step

from care_sim.base.errors import MissingExtra
from care_sim.base.extras import STANDARD_OUTPUT, import_panda_gym, silenced
from care_sim.core.conditions import DEFAULTS
from care_sim.envs import ENVIRONMENT_IDS
from care_sim.measure.bench.config import BenchConfig
from care_sim.measure.driven import driven
from care_sim.sensors.engines import ENGINES
from care_sim.study.episode_play import GymEnv

DRIVING = "highway-fast-v0"
REACHING = "PandaReach-v3"
"""Known environments, under random actions: highway-env's driving without sensors, and panda-gym's
arm, also over PyBullet.
"""

DRIVE_BUDGET = 0.03
DRIVE = f"CARE-Drive-v0 at {DRIVE_BUDGET:.0%}"
"""A row of its own: the longest episodes, with six cameras, at a budget that is published."""
TESTS = ENVIRONMENT_IDS["ncap"]
"""The shortest episodes, of which a study plays the most."""

Maker = Callable[[], GymEnv]


def makers(config: BenchConfig) -> tuple[dict[str, Maker], list[str]]:
    """Makers of all that is measured, the chosen scenario first and also with every other engine,
    and in one line each what is left out.
    """
    chosen = config.episode
    main = ENVIRONMENT_IDS[config.scenario]
    others = [name for name in ENVIRONMENT_IDS if name != config.scenario]
    engines = [name for name in ENGINES if name != DEFAULTS["engine"]]
    made: dict[str, Maker] = {main: partial(driven, chosen)}
    made |= {
        f"{main}, engine {name}": partial(driven, replace(chosen, engine=name)) for name in engines
    }
    made |= {
        ENVIRONMENT_IDS[name]: partial(driven, replace(chosen, scenario=name)) for name in others
    }
    made[DRIVE] = partial(driven, replace(chosen, scenario="drive", budget=DRIVE_BUDGET))
    made[DRIVING] = partial(gymnasium.make, f"highway_env:{DRIVING}", disable_env_checker=True)
    try:
        import_panda_gym()
    except MissingExtra as missing:
        return made, [f"{REACHING}: {missing}"]
    return {**made, REACHING: partial(gymnasium.make, REACHING, disable_env_checker=True)}, []


def speed(maker: Maker, config: BenchConfig) -> dict[str, float]:
    """Figures of one environment: `steps_per_s`, resets included; `steps_per_cpu_s`, steps per
    second that this process itself had the core; and `inits_per_s`, constructions with a reset.
    """
    # Gymnasium says int and takes any number.
    seconds = cast("int", config.seconds)
    with silenced(STANDARD_OUTPUT):
        with maker() as env:
            # What others take of the core is taken out of `steps_per_cpu_s` by the share of the
            # time in which this process worked.
            started = time.perf_counter()
            worked = time.process_time()
            steps = benchmark_step(env, seconds, config.seed)
            share = (time.process_time() - worked) / (time.perf_counter() - started)
        with ExitStack() as made:
            inits = benchmark_init(partial(_one_at_a_time, maker, made), seconds, config.seed)
    return {"steps_per_s": steps, "steps_per_cpu_s": steps / share, "inits_per_s": inits}


def _one_at_a_time(maker: Maker, made: ExitStack) -> GymEnv:
    """A new environment in the place of the one before, which `benchmark_init` leaves open."""
    made.close()
    return made.enter_context(maker())
