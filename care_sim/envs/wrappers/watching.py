"""What the wrappers share that watch an episode and leave it as it is."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import gymnasium

from care_sim.base.errors import InvalidInput, shown
from care_sim.core.types import Action
from care_sim.envs.closed_loop import ClosedLoopEnv
from care_sim.envs.open_loop import OpenLoopEnv
from care_sim.loops.watcher import Watched, Watcher
from care_sim.policies.base import Policy


class Watching(gymnasium.Wrapper[Any, Action, Any, Action], ABC):
    """Records the keyframes of the loop under it.

    It may stand around or inside wrappers that change the action. With the `policy` that acts, the
    shares of exploitation and reserve are known. Of raw actions it is only known what was chosen
    and what the floor filled up.

    Raises InvalidInput for an environment that is no loop of CARE-Sim.
    """

    def __init__(self, env: gymnasium.Env[Any, Action], policy: Policy | None = None):
        inner = getattr(env, "unwrapped", None)
        name = type(self).__name__
        if not (isinstance(env, gymnasium.Env) and isinstance(inner, ClosedLoopEnv | OpenLoopEnv)):
            raise InvalidInput(f"{name} watches a loop of CARE-Sim, got {shown(env)}")
        if not isinstance(policy, Policy | None):
            raise InvalidInput(
                f"policy of {name} must be a care_sim.Policy or None, got {shown(policy)}"
            )
        super().__init__(env)
        self._inner: Any = inner
        self._policy = policy
        self._watcher: Watcher | None = None
        self._begun = False
        self._episodes = 0

    @abstractmethod
    def begin(self, loop: Any, episode: int) -> None:
        """An episode begins, number `episode` from 0: its first keyframe is about to be played."""

    def look(self, loop: Any) -> None:
        """A keyframe is about to be played."""

    @abstractmethod
    def keep(self, watched: Watched) -> None:
        """A keyframe was played."""

    @abstractmethod
    def end(self, outcome: Mapping[str, Any] | None) -> None:
        """The episode is over.

        `outcome` is that of `info`; None for one that was left.
        """

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode. One that was left before its end is closed as it is."""
        self._leave(None)
        answer = super().reset(seed=seed, options=options)
        self._watcher = Watcher(self._inner.loop, self._inner.conditions.camera_confidence)
        return answer

    def step(self, action: Action) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Play a keyframe and keep its record."""
        if self._watcher is None:
            return super().step(action)
        loop = self._inner.loop
        # Not at the reset: one that is followed by another reset leaves no empty file.
        if not self._begun:
            self.begin(loop, self._episodes)
            self._begun = True
            self._episodes += 1
        # Where everything stands is asked before the step, which moves the world on.
        situation = self._watcher.situation()
        self.look(loop)
        observation, reward, terminated, truncated, info = super().step(action)
        demand = self._policy.demanded if self._policy is not None else None
        inner = self._inner
        record = inner.last if isinstance(inner, OpenLoopEnv) else inner.keyframes[-1]
        self.keep(self._watcher.watched(situation, inner.acted, demand, record))
        if terminated or truncated:
            self._leave(info.get("outcome"))
        return observation, reward, terminated, truncated, info

    def close(self) -> None:
        """Close what is kept, then the environment."""
        try:
            self._leave(None)
        finally:
            super().close()

    def _leave(self, outcome: Mapping[str, Any] | None) -> None:
        begun = self._begun
        self._begun = False
        self._watcher = None
        if begun:
            self.end(outcome)


def numbered(path: Path, episode: int) -> Path:
    """Where an episode is kept.

    The first is kept in `path` itself, later ones beside it, with their number.
    """
    if not episode:
        return path
    # A path such as ".." has no name to number.
    path = path if path.stem.strip(".") else path.resolve()
    return path.with_stem(f"{path.stem}-{episode}")
