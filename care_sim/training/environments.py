"""The environments of a training run, wrapped."""

from collections.abc import Callable
from functools import partial
from itertools import cycle, islice
from typing import TYPE_CHECKING, Any

import gymnasium

from care_sim.base.processes import following, starting
from care_sim.envs import OPEN_LOOP, make_env
from care_sim.envs.wrappers.grid_observation import GridObservation
from care_sim.envs.wrappers.sector_actions import SectorReserve, SectorScores
from care_sim.training.config import AgentConfig
from care_sim.training.seeds import TrainingSeeds

if TYPE_CHECKING:
    from stable_baselines3.common.vec_env import VecEnv

ACTIONS = {wrapper.__name__: wrapper for wrapper in (SectorReserve, SectorScores)}


def plain(config: AgentConfig, budget: float | None = None) -> gymnasium.Env[Any, Any]:
    """The environment without wrappers, which the rules play.

    Its budget is `budget`, or the first of the configuration. Raises InvalidInput for an unknown
    environment or a wrong argument.
    """
    # Only the closed loop has a reward of weighted terms.
    reward: dict[str, Any] = (
        {} if config.env in OPEN_LOOP else {"reward_weights": {"gain": config.gain}}
    )
    arguments = (
        {"budget": config.budget[0] if budget is None else budget} | reward | config.arguments
    )
    return make_env(config.env, **arguments)


def wrapped(config: AgentConfig, budget: float | None = None) -> gymnasium.Env[Any, Any]:
    """As the learner acts and sees."""
    acting = ACTIONS[config.action](plain(config, budget), config.azimuths, config.elevations)
    return GridObservation(acting, config.columns, config.rows)


def training(config: AgentConfig, budget: float) -> gymnasium.Env[Any, Any]:
    """The same, over episodes of training seeds."""
    return TrainingSeeds(wrapped(config, budget), config.seed)


def side_by_side(config: AgentConfig) -> "VecEnv":
    """The training environments as one vector, which reports episodes to the learner's log."""
    from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecMonitor

    budgets = islice(cycle(config.budget), config.environments)
    makers: list[Callable[[], gymnasium.Env[Any, Any]]] = [
        partial(training, config, budget) for budget in budgets
    ]
    if config.processes:
        # Spawned, not forked: PyTorch has threads by now, and a fork copies their locks.
        with starting():
            return VecMonitor(
                SubprocVecEnv([partial(following, maker) for maker in makers], start_method="spawn")
            )
    return VecMonitor(DummyVecEnv(makers))
