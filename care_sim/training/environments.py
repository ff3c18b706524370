"""The environments of a training run, wrapped."""

from collections.abc import Callable
from functools import partial
from itertools import cycle, islice
from typing import TYPE_CHECKING, Any

import gymnasium
from gymnasium.vector import AutoresetMode

from care_sim.base.processes import following, starting
from care_sim.envs import CLOSED_LOOP, OPEN_LOOP, installed_ids, make_env
from care_sim.envs.wrappers.grid_observation import GridObservation, VectorGridObservation
from care_sim.envs.wrappers.sector_actions import (
    SectorReserve,
    SectorScores,
    VectorSectorReserve,
    VectorSectorScores,
)
from care_sim.training.config import AgentConfig
from care_sim.training.drawn import Draw, DrawnEnv, DrawnStreet, Mirrored, MissedChances, drawn
from care_sim.training.seeds import TrainingSeeds, VectorTrainingSeeds, validation_seeds

if TYPE_CHECKING:
    from stable_baselines3.common.vec_env import VecEnv

STREETS_ID = "CARE-Street-v0"
ACTIONS = {wrapper.__name__: wrapper for wrapper in (SectorReserve, SectorScores)}
VECTOR_ACTIONS = {
    wrapper.single.__name__: wrapper for wrapper in (VectorSectorReserve, VectorSectorScores)
}


def plain(config: AgentConfig, budget: float | None = None) -> gymnasium.Env[Any, Any]:
    """Return the environment without wrappers, which the rules play. Its budget is `budget`, or the
    configuration's first one, or drawn for every episode. Raises InvalidInput for an unknown
    environment or a wrong argument.
    """
    if config.drawn:
        return _drawn(config, lambda env, _: env, budget)
    return make_env(
        config.env[0],
        **_arguments(config, config.env[0], config.budget[0] if budget is None else budget),
    )


def wrapped(config: AgentConfig, budget: float | None = None) -> gymnasium.Env[Any, Any]:
    """Return the environment as the learner acts and observes."""
    if config.drawn:
        return _drawn(config, partial(_as_drawn, config))
    return _pictured(config, plain(config, budget))


def training(config: AgentConfig, budget: float | None = None) -> gymnasium.Env[Any, Any]:
    """Return the wrapped environment over training seeds, without camera faults if they are left
    out. Validations keep the faults: recipes are measured in the same episodes.
    """
    if config.drawn:
        env = _drawn(config, partial(_as_drawn, config), faulty="faults" not in config.without)
        return TrainingSeeds(env, config.seed)
    return TrainingSeeds(wrapped(config, budget), config.seed)


def _pictured(config: AgentConfig, env: gymnasium.Env[Any, Any]) -> GridObservation:
    acting = ACTIONS[config.action](env, config.azimuths, config.elevations)
    return GridObservation(acting, config.columns, config.rows)


def _drawn(
    config: AgentConfig,
    finish: Callable[[gymnasium.Env[Any, Any], Draw], gymnasium.Env[Any, Any]],
    budget: float | None = None,
    faulty: bool = True,
) -> DrawnEnv:
    """Return drawn episodes under their common reward. `budget` replaces drawn budgets; the rest of
    an episode stays.
    """

    def make(draw: Draw) -> gymnasium.Env[Any, Any]:
        name = config.env[draw.place]
        share = draw.budget if budget is None else budget
        given = {**_arguments(config, name, share), **draw.faults}
        env = DrawnStreet(draw.street, **given) if name == STREETS_ID else make_env(name, **given)
        return finish(MissedChances(env), draw)

    return DrawnEnv(make, len(config.env), config.budget, faulty)


def _as_drawn(
    config: AgentConfig, env: gymnasium.Env[Any, Any], draw: Draw
) -> gymnasium.Env[Any, Any]:
    pictured = _pictured(config, env)
    return Mirrored(pictured, pictured.features.shape) if draw.mirrored else pictured


def validation_episodes(config: AgentConfig) -> dict[int, str]:
    """Return the environment of every validation seed."""
    names = config.env
    return {
        seed: names[drawn(seed, len(names), config.budget).place]
        for seed in validation_seeds(config.episodes)
    }


def side_by_side(config: AgentConfig) -> "VecEnv":
    """Return the training environments as one vector, which reports episodes to the learner's
    log.
    """
    from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecMonitor

    from care_sim.training.vec_env import GymnasiumVecEnv

    budgets = [*islice(cycle(config.budget), config.environments)]
    # Worlds of one vector share a scenario; drawn episodes do not.
    is_vector = not config.drawn and config.env[0] in (*CLOSED_LOOP, *installed_ids())
    if is_vector and not config.processes:
        return VecMonitor(GymnasiumVecEnv(worlds(config, budgets)))
    makers: list[Callable[[], gymnasium.Env[Any, Any]]] = [
        partial(training, config, budget) for budget in budgets
    ]
    if not config.processes:
        return VecMonitor(DummyVecEnv(makers))
    # Spawned, not forked: PyTorch has threads by now, and a fork copies their locks.
    with starting():
        return VecMonitor(
            SubprocVecEnv([partial(following, maker) for maker in makers], start_method="spawn")
        )


def worlds(config: AgentConfig, budgets: list[float]) -> VectorGridObservation:
    """Return one vector environment of the worlds that `training` makes one by one, each with its
    budget.
    """
    (name,) = config.env
    # Learners' pictures are drawn at once, and need no copies of observations.
    vector = gymnasium.make_vec(
        f"care_sim:{name}",
        len(budgets),
        "vector_entry_point",
        autoreset_mode=AutoresetMode.DISABLED,
        copy=False,
        **_arguments(config, name, budgets),
    )
    seeded = VectorTrainingSeeds(vector, config.seed)
    acting = VECTOR_ACTIONS[config.action](seeded, config.azimuths, config.elevations)
    return VectorGridObservation(acting, config.columns, config.rows)


def _arguments(config: AgentConfig, name: str, budget: float | list[float]) -> dict[str, Any]:
    # Only the closed loop has a reward of weighted terms; drawn episodes have another one.
    weighted = not (config.drawn or name in OPEN_LOOP)
    reward: dict[str, Any] = {"reward_weights": {"gain": config.gain}} if weighted else {}
    # No learner reads the information, and evaluations read outcomes, which stay.
    scoring = {"scoring_info": False}
    return {"budget": budget} | reward | scoring | config.arguments(name)
