"""Gymnasium's vector environments as one `VecEnv` of Stable-Baselines3.

The module subclasses a class of Stable-Baselines3 and so needs the optional extra 'rl'.
"""

from collections.abc import Mapping, Sequence
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
    """All worlds of one vector environment, or of several, as a learner of Stable-Baselines3 takes
    them: what `DummyVecEnv` of the single environments answers.

    The worlds of several vector environments of the same spaces come in turn: with two vectors of
    three worlds each, 0, 2 and 4 are those of the first. Learners need the mode "SameStep" of
    `autoreset_mode`. In infos None may read NaN, as in all of Gymnasium's vectors. Attributes of a
    world are its own, or else those of its vector environment, which has no methods for one world
    alone. Raises InvalidInput for other modes, sizes and spaces.
    """

    def __init__(self, *envs: AnyVector):
        _check(envs)
        self.envs = envs
        # The places of the worlds of every vector environment.
        self._places = [slice(n, None, len(envs)) for n in range(len(envs))]
        self._actions: NDArray[Any] | None = None
        worlds = sum(env.num_envs for env in envs)
        super().__init__(worlds, envs[0].single_observation_space, envs[0].single_action_space)

    def reset(self) -> VecEnvObs:
        """Begin episodes everywhere, with the seeds of `seed`."""
        if any(self._options):
            raise InvalidInput(f"reset takes no options, got {shown(self._options)}")
        begun = [
            env.reset(seed=self._seeds[place])  # type: ignore[arg-type]
            for env, place in zip(self.envs, self._places, strict=True)
        ]
        # Seeds are for one reset.
        self._reset_seeds()
        self.reset_infos = self._each([infos for _, infos in begun])
        seen: VecEnvObs = self._joined([observation for observation, _ in begun])
        return seen

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take the actions (W, ...) of the next `step_wait`."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Observations, rewards (W,) float32, whether episodes are over (W,), and infos."""
        if self._actions is None:
            raise gymnasium.error.ResetNeeded("call step_async() before step_wait()")
        actions, self._actions = self._actions, None
        rewards = np.empty(self.num_envs, np.float32)
        terminated, truncated = np.empty((2, self.num_envs), np.bool_)
        observations, told = list[Any](), list[dict[str, Any]]()
        for env, place in zip(self.envs, self._places, strict=True):
            seen, rewards[place], terminated[place], truncated[place], own = env.step(
                actions[place]
            )
            observations.append(seen)
            told.append(own)
        over = terminated | truncated
        infos = self._infos(told, over)
        for info, late in zip(infos, (truncated & ~terminated).tolist(), strict=True):
            info["TimeLimit.truncated"] = late
        return self._joined(observations), rewards, over, infos

    def close(self) -> None:
        """Close the vector environments."""
        for env in self.envs:
            env.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """An attribute of every world: that of the outermost wrapper of its vector environment
        which has it, or else its own. Raises AttributeError for another.
        """
        each = [_attributes(env, attr_name) for env in self.envs]
        count = len(self.envs)
        return [each[world % count][world // count] for world in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of the vector environments. Raises InvalidInput for some of the worlds
        of one.
        """
        chosen = [id(env) for env in self._of(indices)]
        for env in self.envs:
            if chosen.count(id(env)) not in (0, env.num_envs):
                raise InvalidInput(f"{attr_name} is one for all worlds of a vector environment")
        for env in self.envs:
            if id(env) in chosen:
                setattr(env, attr_name, value)

    def env_method(
        self, method_name: str, *_: Any, indices: VecEnvIndices = None, **__: Any
    ) -> list[Any]:
        """Raises InvalidInput: a method of a vector environment is for all its worlds."""
        raise InvalidInput(
            f"{method_name} cannot be called for one world of a vector environment; call that of "
            "`envs`, which is for all worlds"
        )

    def env_is_wrapped(
        self,
        wrapper_class: type[gymnasium.Wrapper[Any, Any, Any, Any]],
        indices: VecEnvIndices = None,
    ) -> list[bool]:
        """Whether the vector environment of every world stands in a wrapper of that class, or in
        the one that is its like for vectors.
        """
        return [
            any(issubclass(kind, wrapper_class) for kind in _wrappers(env))
            for env in self._of(indices)
        ]

    def _of(self, indices: VecEnvIndices) -> list[AnyVector]:
        return [self.envs[world % len(self.envs)] for world in self._get_indices(indices)]

    def _joined(self, observations: list[Any]) -> Any:
        """The observations of all worlds, of which the next step leaves nothing changed: learners
        read the last ones after it.
        """
        if len(observations) == 1 and getattr(self.envs[0].unwrapped, "copy", True):
            return observations[0]
        if isinstance(self.observation_space, spaces.Dict):
            return {
                name: self._interleaved([seen[name] for seen in observations])
                for name in self.observation_space
            }
        return self._interleaved(observations)

    def _interleaved(self, parts: list[NDArray[Any]]) -> NDArray[Any]:
        rows = np.empty((self.num_envs, *parts[0].shape[1:]), parts[0].dtype)
        for place, part in zip(self._places, parts, strict=True):
            rows[place] = part
        return rows

    def _infos(self, told: list[dict[str, Any]], over: NDArray[np.bool_]) -> Infos:
        """What every world tells of the step. Of the episodes that begin in worlds that are `over`,
        `reset_infos` tells.
        """
        infos = self._each(told)
        if over.any():
            last = self._each([own.get("final_info", {}) for own in told])
            for world in np.flatnonzero(over).tolist():
                env, row = world % len(self.envs), world // len(self.envs)
                self.reset_infos[world], infos[world] = infos[world], last[world]
                infos[world]["terminal_observation"] = told[env]["final_obs"][row]
        return infos

    def _each(self, told: list[dict[str, Any]]) -> Infos:
        infos: Infos = [{} for _ in range(self.num_envs)]
        for own, place in zip(told, self._places, strict=True):
            infos[place] = info_of_each(own, len(infos[place]))
        return infos


def info_of_each(infos: Mapping[str, Any], worlds: int) -> Infos:
    """The info of each of so many worlds, from that of a vector environment; see
    `gymnasium.vector.VectorEnv`.
    """
    each: Infos = [{} for _ in range(worlds)]
    for name, column in infos.items():
        who = infos.get(f"_{name}")
        # Last observations and infos are not what a world tells of its step.
        if who is None or name in ("final_obs", "final_info"):
            continue
        if isinstance(column, dict):
            rows: list[Any] = info_of_each(column, worlds)
        else:
            # Numbers become those of Python, which the single environments tell.
            rows = column.tolist() if column.ndim == 1 else [*column]
        for world in np.flatnonzero(who).tolist():
            each[world][name] = rows[world]
    return each


def _check(envs: Sequence[AnyVector]) -> None:
    if not envs or not all(isinstance(env, VectorEnv) for env in envs):
        raise InvalidInput(f"vector environments of Gymnasium are needed, got {shown(envs)}")
    worlds = range(sum(env.num_envs for env in envs))
    for place, env in enumerate(envs):
        mode = env.metadata.get("autoreset_mode")
        if mode != AutoresetMode.SAME_STEP:
            told = mode.value if isinstance(mode, AutoresetMode) else shown(mode)
            raise InvalidInput(f"autoreset_mode must be SameStep for Stable-Baselines3, got {told}")
        for what in ("single_observation_space", "single_action_space"):
            if getattr(env, what) != getattr(envs[0], what):
                raise InvalidInput(f"vector environments must have one {what}, these differ")
        if env.num_envs != len(worlds[place :: len(envs)]):
            sizes = [env.num_envs for env in envs]
            raise InvalidInput(
                f"worlds of several vector environments come in turn: their numbers must be equal,"
                f" or one less from some place on, got {sizes}"
            )


def _attributes(env: AnyVector, name: str) -> list[Any]:
    """An attribute of each world of a vector environment."""
    layer = env
    while isinstance(layer, VectorWrapper):
        if hasattr(layer, name):
            return [getattr(layer, name)] * env.num_envs
        layer = layer.env
    try:
        return attribute_of_each(layer, name)
    except AttributeError:
        return [getattr(layer, name)] * env.num_envs


def _wrappers(env: AnyVector) -> list[type]:
    """The classes of the wrappers, and those of which they are the like for vectors."""
    kinds = list[type]()
    layer = env
    while isinstance(layer, VectorWrapper):
        kinds += [type(layer), *([layer.single] if hasattr(layer, "single") else [])]
        layer = layer.env
    return kinds
