"""Episodes of validation seeds, without exploration."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

import care_sim

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm

Row = dict[str, Any]
"""The result of an episode: `seed`, `env`, `return`, and `distance_m`, the metres at which the
first-sighting actor was detected. The distance is 0 without a detection, None in the open loop.
"""
Choose = Callable[[Any, bool], NDArray[np.float32]]
"""Returns the action for an observation. The flag is True at the beginning of an episode."""


@dataclass(frozen=True)
class ValidationScore:
    """Means over episodes: the return, and the first-detection distance, None unless every episode
    has one.
    """

    episodes: int
    mean_return: float
    distance_m: float | None

    @classmethod
    def of(cls, played: Sequence[Row]) -> "ValidationScore":
        """Return the means of one or more episodes."""
        metres = [row["distance_m"] for row in played]
        mean_m = None if None in metres else float(np.mean(metres))
        return cls(len(played), float(np.mean([row["return"] for row in played])), mean_m)

    def __str__(self) -> str:
        seen = (
            ""
            if self.distance_m is None
            else f", first detection at {self.distance_m:.2f} m (0 where never)"
        )
        return f"return {self.mean_return:.2f}{seen}"


def play(env: gymnasium.Env[Any, Any], choose: Choose, episodes: Mapping[int, str]) -> list[Row]:
    """Play the episodes of the seeds, whose environments are named."""
    return [_episode(env, choose, seed, name) for seed, name in episodes.items()]


def acting(learner: "BaseAlgorithm") -> Choose:
    """Return the learner's choice of actions, with its memory between keyframes."""
    memory = None

    def choose(observation: Any, begins: bool) -> NDArray[np.float32]:
        nonlocal memory
        begin = np.array([begins])
        action, memory = learner.predict(
            observation, None if begins else memory, begin, deterministic=True
        )
        return np.asarray(action)

    return choose


def rule(name: str, env: gymnasium.Env[Any, Any]) -> Choose:
    """Return the choice of actions of a named policy. It is made anew for every episode, since
    drawn episodes have their own rigs.
    """
    policy: care_sim.Policy

    def choose(observation: Any, begins: bool) -> NDArray[np.float32]:
        nonlocal policy
        if begins:
            policy = care_sim.make_policy(name, env.unwrapped)
            policy.reset()
        return policy(observation)

    return choose


def _episode(env: gymnasium.Env[Any, Any], choose: Choose, seed: int, name: str) -> Row:
    observation, _ = env.reset(seed=seed)
    total = 0.0
    begins = True
    over = False
    while not over:
        observation, reward, terminated, truncated, info = env.step(choose(observation, begins))
        total = total + float(reward)
        begins = False
        over = terminated or truncated
    outcome: dict[str, Any] = info["outcome"]
    # An actor that is never detected counts as 0 m, the worst value. The open loop has no such
    # distance.
    distance = outcome["detection_distance_m"] or 0.0 if "detection_distance_m" in outcome else None
    return {"seed": seed, "env": name, "return": total, "distance_m": distance}
