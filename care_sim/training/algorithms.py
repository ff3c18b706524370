"""The learners of Stable-Baselines3 and sb3-contrib, made from a configuration.

Both libraries are imported when a learner is trained, since their extra 'rl' is optional.
"""

import math
from typing import TYPE_CHECKING, Any

from care_sim.base.extras import missing_extra
from care_sim.policies.learned.grid_features import CHANNELS
from care_sim.training.config import AgentConfig, OnPolicy, PpoConfig, RecurrentPpoConfig, SacConfig

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm

TENSORBOARD = "tensorboard"
"""Folder of the logs for TensorBoard, in that of the run."""


def algorithm(name: str) -> Any:
    """The class of a learner, a `BaseAlgorithm`.

    Raises MissingExtra for one that is not installed.
    """
    try:
        if name == "recurrent-ppo":
            from sb3_contrib import RecurrentPPO

            return RecurrentPPO
        from stable_baselines3 import PPO, SAC
    except ImportError as error:
        raise missing_extra(name, "rl", error) from error
    return {"ppo": PPO, "sac": SAC}[name]


def make_learner(config: AgentConfig, envs: Any, goes_round: bool = True) -> "BaseAlgorithm":
    """A learner that has learned nothing yet; `goes_round` says whether the grid does."""
    policy, options = _settings(config, goes_round)
    log = str(config.out / TENSORBOARD) if config.tensorboard else None
    learner: BaseAlgorithm = algorithm(config.algorithm)(
        policy=policy,
        env=envs,
        learning_rate=config.learning_rate,
        gamma=config.discount,
        seed=config.seed,
        device="cpu",
        tensorboard_log=log,
        **options,
    )
    return learner


def _settings(config: AgentConfig, goes_round: bool) -> tuple[Any, dict[str, Any]]:
    """The policy, and the options that are the learner's own."""
    # The module subclasses PyTorch's and Stable-Baselines3's classes: optional extra 'rl'.
    from care_sim.training.networks import Sectored, SectorPolicy

    shape = len(CHANNELS), config.rows, config.columns
    seen = {"shape": shape, "goes_round": goes_round, "without": config.without}
    # PPO scores sectors with the network that `ppo` later runs in NumPy. The others keep their own
    # networks behind features of the sectors, since their critics or memories need a vector.
    own = {
        "features_extractor_class": Sectored,
        "features_extractor_kwargs": seen | {"sectors": (config.elevations, config.azimuths)},
    }
    if isinstance(config, PpoConfig):
        kwargs = seen | {"hidden": config.hidden, "log_std_init": math.log(config.noise)}
        return SectorPolicy, _on_policy(config) | {"policy_kwargs": kwargs}
    if isinstance(config, RecurrentPpoConfig):
        kwargs = own | {"log_std_init": math.log(config.noise)}
        return "MultiInputLstmPolicy", _on_policy(config) | {"policy_kwargs": kwargs}
    assert isinstance(config, SacConfig)
    return "MultiInputPolicy", {
        "buffer_size": config.memory,
        "batch_size": config.batch,
        "policy_kwargs": own,
    }


def _on_policy(config: OnPolicy) -> dict[str, Any]:
    return {
        "n_steps": config.rollout,
        "batch_size": config.batch,
        "n_epochs": config.epochs,
        "gae_lambda": 0.9,
    }
