"""Environments that drive themselves: measures of speed need no agent."""

from typing import Any

import gymnasium
from gymnasium import spaces

from care_sim.envs.sensing import Observed
from care_sim.policies.base import Policy
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.episode_play import GymEnv


class Driven(gymnasium.Wrapper[Observed, Any, Any, Any]):
    """An environment that a policy steers, whatever the action."""

    def __init__(self, env: GymEnv, policy: Policy):
        super().__init__(env)
        # Gymnasium's measures draw an action for every step: to draw scores of 16,384 cells would
        # count as time of the environment.
        self.action_space = spaces.Discrete(1)
        self.policy = policy

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observed, dict[str, Any]]:
        """Begin an episode."""
        self.policy.reset()
        self._observation, info = self.env.reset(seed=seed, options=options)
        return self._observation, info

    def step(self, action: Any) -> tuple[Observed, Any, bool, bool, dict[str, Any]]:
        """Let the policy act."""
        result = self.env.step(self.policy(self._observation))
        self._observation = result[0]
        return result


def driven(config: EpisodeConfig) -> Driven:
    """The environment of an episode, steered by its policy."""
    env = config.make_env()
    return Driven(env, config.make_policy(env))
