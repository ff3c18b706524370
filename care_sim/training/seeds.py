"""Episodes with only training or only validation seeds (`care_sim.base.seeds`)."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from numpy.typing import NDArray

from care_sim.base.errors import InvalidInput, shown
from care_sim.base.seeds import LAST, TRAINING, VALIDATION
from care_sim.core.arrays import Mask
from care_sim.envs.vector.arguments import last_rows
from care_sim.envs.wrappers.reading import WorldsWrapper


class TrainingSeeds(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Every reset begins an episode of a training seed.

    The learner's seed and the one given to `reset` decide the sequence of them.

    Stable-Baselines3 counts the seed of `reset` up from environment to environment. Without the
    learner's, learners of neighbouring seeds would share most of their episodes.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], learner: int = 0):
        super().__init__(env)
        self._seeds = _Sequence(learner)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin the next episode."""
        return self.env.reset(seed=self._seeds.next(seed), options=options)


class VectorTrainingSeeds(WorldsWrapper):
    """`TrainingSeeds` over a vector environment in the mode "Disabled". It begins the episodes
    itself, so its own mode is "SameStep". Raises InvalidInput for another mode, and for a reset
    mask.
    """

    single = TrainingSeeds

    def __init__(self, env: VectorEnv[Any, Any, Any], learner: int = 0):
        super().__init__(env)
        if env.metadata.get("autoreset_mode") != AutoresetMode.DISABLED:
            raise InvalidInput("autoreset_mode must be Disabled for VectorTrainingSeeds")
        self.metadata = {**env.metadata, "autoreset_mode": AutoresetMode.SAME_STEP}
        self._seeds = [_Sequence(learner) for _ in range(self.num_envs)]

    def reset(
        self, *, seed: Any = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin the next episode in every world; `seed` is one number, to which world i adds i, or
        a list of one each.
        """
        if options:
            raise InvalidInput(f"reset takes no options, got {shown(options)}")
        given = (
            [seed] * self.num_envs
            if seed is None
            else [seed + world for world in range(self.num_envs)]
            if isinstance(seed, int | np.integer)
            else [*seed]
        )
        if len(given) != self.num_envs:
            raise InvalidInput(f"seed must be one for each of {self.num_envs}, got {len(given)}")
        drawn = [own.next(one) for own, one in zip(self._seeds, given, strict=True)]
        return self.env.reset(seed=drawn)  # type: ignore[arg-type]

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Go on to the next keyframe; where an episode ends, the next one begins."""
        observation, rewards, terminated, truncated, infos = self.env.step(actions)
        over = terminated | truncated
        if over.any():
            # Before the reset, which may write over them.
            last = last_rows(observation, over)
            drawn = [
                own.next() if ends else None
                for own, ends in zip(self._seeds, over.tolist(), strict=True)
            ]
            observation, begun = self.env.reset(
                seed=drawn,  # type: ignore[arg-type]
                options={"reset_mask": over.copy()},
            )
            infos = _same_step(infos, begun, last, over)
        return observation, rewards, terminated, truncated, infos


_Infos = dict[str, Any]


def _same_step(infos: _Infos, begun: _Infos, last: NDArray[np.object_], over: Mask) -> _Infos:
    """Return a step's infos if worlds that are `over` begin new episodes. `infos` are of all
    worlds, `last` (W,) the final observations, `begun` the infos of the new episodes.
    """
    finals = {
        "final_obs": last,
        "_final_obs": over.copy(),
        "final_info": _part(infos, over),
        "_final_info": over.copy(),
    }
    return _joined(_part(infos, ~over), begun) | finals


def _part(infos: _Infos, who: Mask) -> _Infos:
    """Return the infos of the worlds in `who` (W,), in the form of Gymnasium."""
    part = _Infos()
    for name, column in _columns(infos):
        told = infos[f"_{name}"] & who
        if told.any():
            part[name] = _part(column, who) if isinstance(column, dict) else column.copy()
            part[f"_{name}"] = told
            if not isinstance(column, dict):
                part[name][~told] = None if column.dtype == object else 0
    return part


def _joined(infos: _Infos, others: _Infos) -> _Infos:
    """Merge infos; the `others` belong to other worlds."""
    joined = infos | {name: value for name, value in others.items() if name not in infos}
    for name, column in _columns(others):
        if name not in infos:
            continue
        told = others[f"_{name}"]
        if isinstance(column, dict):
            joined[name] = _joined(infos[name], column)
        else:
            joined[name] = infos[name].copy()
            joined[name][told] = column[told]
        joined[f"_{name}"] = infos[f"_{name}"] | told
    return joined


def _columns(infos: _Infos) -> list[tuple[str, Any]]:
    return [(name, column) for name, column in infos.items() if f"_{name}" in infos]


class _Sequence:
    """The training seeds of one world."""

    def __init__(self, learner: int):
        self._learner = learner
        self._rng = np.random.default_rng()

    def next(self, seed: int | None = None) -> int:
        """Return the next seed; with a `seed`, the first of another sequence."""
        if seed is not None:
            self._rng = np.random.default_rng((seed, self._learner))
        return int(self._rng.integers(TRAINING, LAST))


def validation_seeds(episodes: int) -> range:
    """Return the first `episodes` validation seeds. Raises InvalidInput for more than there are."""
    if episodes > TRAINING - VALIDATION:
        raise InvalidInput(
            f"episodes must be at most {TRAINING - VALIDATION}, the validation seeds, got "
            f"{episodes}"
        )
    return range(VALIDATION, VALIDATION + episodes)
