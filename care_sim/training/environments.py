"""The environments of a training run, wrapped."""

from functools import partial
from typing import TYPE_CHECKING, Any

import gymnasium

import care_sim
from care_sim.envs import CLOSED_LOOP
from care_sim.envs.grid_observation import GridObservation
from care_sim.envs.sector_actions import SectorReserve, SectorScores
from care_sim.errors import unknown
from care_sim.training.config import AgentConfig
from care_sim.training.seeds import TrainingSeeds

if TYPE_CHECKING:
    from stable_baselines3.common.vec_env import VecEnv

ACTIONS = {"SectorReserve": SectorReserve, "SectorScores": SectorScores}


def bare(config: AgentConfig) -> gymnasium.Env[Any, Any]:
    """The environment without wrappers, for the rules. Raises InvalidInput for an unknown one or a wrong argument."""
    known = care_sim.envs.IDS
    if config.env not in known:
        raise unknown("environment", config.env, known)
    reward = {"reward_weights": {"gain": config.gain}} if config.env in CLOSED_LOOP else {}
    return gymnasium.make(f"care_sim:{config.env}", disable_env_checker=True, **reward, **config.arguments)


def wrapped(config: AgentConfig) -> gymnasium.Env[Any, Any]:
    """As the learner acts and sees."""
    acting = ACTIONS[config.action](bare(config), config.azimuths, config.elevations)
    return GridObservation(acting, config.columns, config.rows)


def training(config: AgentConfig) -> gymnasium.Env[Any, Any]:
    """The same over training seeds; tells Stable-Baselines3 nothing of `info` but the end of an episode."""
    return TrainingSeeds(wrapped(config))


def side_by_side(config: AgentConfig) -> "VecEnv":
    """The training environments as one, seeded and watched."""
    from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecMonitor

    makers = [partial(training, config)] * config.environments
    envs: VecEnv = SubprocVecEnv(makers, start_method="spawn") if config.processes else DummyVecEnv(makers)
    envs.seed(config.seed)
    return VecMonitor(envs)
