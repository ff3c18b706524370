"""A vector environment of Gymnasium as a `VecEnv` of Stable-Baselines3.

The module subclasses a class of Stable-Baselines3 and so needs the optional extra 'rl'.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from numpy.typing import NDArray
from stable_baselines3.common.vec_env.base_vec_env import (
    VecEnv,
    VecEnvIndices,
    VecEnvObs,
    VecEnvStepReturn,
)

from care_sim.base.errors import InvalidInput, shown
from care_sim.base.vectors import attribute_of_each
from care_sim.envs.wrappers.reading import AnyVector

Infos = list[dict[str, Any]]


class GymnasiumVecEnv(VecEnv):
    """All worlds of a vector environment for a learner of Stable-Baselines3. Results equal those of
    `DummyVecEnv` over the single environments. Learners need the mode "SameStep" of
    `autoreset_mode`. In infos None may read NaN, as in all of Gymnasium's vectors. Attributes of a
    world are its own, or else those of its vector environment. Methods of single worlds are not
    available. Raises InvalidInput for another mode.
    """

    def __init__(self, env: AnyVector):
        if not isinstance(env, VectorEnv):
            raise InvalidInput(f"a vector environment of Gymnasium is needed, got {shown(env)}")
        mode = env.metadata.get("autoreset_mode")
        if mode != AutoresetMode.SAME_STEP:
            told = mode.value if isinstance(mode, AutoresetMode) else shown(mode)
            raise InvalidInput(f"autoreset_mode must be SameStep for Stable-Baselines3, got {told}")
        self.env = env
        self._actions: NDArray[Any] | None = None
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)

    def reset(self) -> VecEnvObs:
        """Begin episodes everywhere, with the seeds of `seed`."""
        if any(self._options):
            raise InvalidInput(f"reset takes no options, got {shown(self._options)}")
        observation, infos = self.env.reset(seed=self._seeds)  # type: ignore[arg-type]
        # Seeds are for one reset.
        self._reset_seeds()
        self.reset_infos = info_of_each(infos, self.num_envs)
        seen: VecEnvObs = self._kept(observation)
        return seen

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take the actions (W, ...) of the next `step_wait`."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Return observations, rewards (W,) float32, whether episodes are over (W,), and infos."""
        if self._actions is None:
            raise gymnasium.error.ResetNeeded("call step_async() before step_wait()")
        actions, self._actions = self._actions, None
        observation, rewards, terminated, truncated, told = self.env.step(actions)
        over = terminated | truncated
        infos = self._infos(told, over)
        for info, late in zip(infos, (truncated & ~terminated).tolist(), strict=True):
            info["TimeLimit.truncated"] = late
        return self._kept(observation), rewards.astype(np.float32), over, infos

    def close(self) -> None:
        """Close the vector environment."""
        self.env.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return an attribute of every world: that of the outermost wrapper with the attribute, or
        its own. Raises AttributeError without one.
        """
        each = self._attributes(attr_name)
        return [each[world] for world in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of the vector environment. Raises InvalidInput for some worlds alone."""
        if {*self._get_indices(indices)} != {*range(self.num_envs)}:
            raise InvalidInput(f"{attr_name} is one for all worlds of a vector environment")
        setattr(self.env, attr_name, value)

    def env_method(
        self, method_name: str, *_: Any, indices: VecEnvIndices = None, **__: Any
    ) -> list[Any]:
        """Raises InvalidInput: a method of a vector environment is for all its worlds."""
        raise InvalidInput(
            f"{method_name} cannot be called for one world of a vector environment; call that of "
            "`env`, which is for all worlds"
        )

    def env_is_wrapped(
        self,
        wrapper_class: type[gymnasium.Wrapper[Any, Any, Any, Any]],
        indices: VecEnvIndices = None,
    ) -> list[bool]:
        """Return True if the vector environment has a wrapper of that class, or of its vector
        version.
        """
        kinds = [
            kind for one in self._wrappers() for kind in (type(one), getattr(one, "single", None))
        ]
        told = any(kind is not None and issubclass(kind, wrapper_class) for kind in kinds)
        return [told] * len([*self._get_indices(indices)])

    def _wrappers(self) -> Iterator[VectorWrapper[Any, Any, Any]]:
        layer = self.env
        while isinstance(layer, VectorWrapper):
            yield layer
            layer = layer.env

    def _attributes(self, name: str) -> list[Any]:
        for layer in self._wrappers():
            if hasattr(layer, name):
                return [getattr(layer, name)] * self.num_envs
        try:
            return attribute_of_each(self.env, name)
        except AttributeError:
            return [getattr(self.env.unwrapped, name)] * self.num_envs

    def _kept(self, observation: Any) -> Any:
        """Return the observation in a form that the next step does not overwrite: learners read it
        later.
        """
        if getattr(self.env.unwrapped, "copy", True):
            return observation
        if isinstance(self.observation_space, spaces.Dict):
            return {name: rows.copy() for name, rows in observation.items()}
        return observation.copy()

    def _infos(self, told: dict[str, Any], over: NDArray[np.bool_]) -> Infos:
        """Return the infos of every world at the step. `reset_infos` are for the episodes that
        begin in worlds that are `over`.
        """
        infos = info_of_each(told, self.num_envs)
        if over.any():
            last = info_of_each(told.get("final_info", {}), self.num_envs)
            for world in np.flatnonzero(over).tolist():
                self.reset_infos[world], infos[world] = infos[world], last[world]
                infos[world]["terminal_observation"] = told["final_obs"][world]
        return infos


def info_of_each(infos: Mapping[str, Any], worlds: int) -> Infos:
    """Split the info of a vector environment into one per world; see
    `gymnasium.vector.VectorEnv`.
    """
    each: Infos = [{} for _ in range(worlds)]
    for name, column in infos.items():
        who = infos.get(f"_{name}")
        # Final observations and infos are not part of a world's own info.
        if who is None or name in ("final_obs", "final_info"):
            continue
        if isinstance(column, dict):
            rows: list[Any] = info_of_each(column, worlds)
        else:
            # Numbers become Python's own, as in the single environments.
            rows = column.tolist() if column.ndim == 1 else [*column]
        for world in np.flatnonzero(who).tolist():
            each[world][name] = rows[world]
    return each
