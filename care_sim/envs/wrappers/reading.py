"""The settings of a wrapped environment, and its observation, read once for all wrappers."""

from dataclasses import replace
from typing import Any

import gymnasium
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper

from care_sim.base.errors import InvalidInput, shown
from care_sim.base.vectors import attribute_of_each
from care_sim.core.belief import OBSERVED, Observation
from care_sim.core.beliefs import Beliefs
from care_sim.core.rig import Rig

AnyVector = VectorEnv[Any, Any, Any]


class WorldsWrapper(VectorWrapper[Any, Any, Any, Any, Any]):
    """A wrapper of a vector environment."""

    @property
    def autoreset_mode(self) -> AutoresetMode:
        """As in Gymnasium's own vector environments; TorchRL reads it there."""
        mode: AutoresetMode = self.metadata["autoreset_mode"]
        return mode


def rig_of(env: AnyVector) -> Rig:
    """The rig of all worlds of a vector environment, one of CARE-Sim or one of Gymnasium over
    environments of CARE-Sim; where budgets differ, that of the largest. Raises InvalidInput for
    another, and for worlds whose rigs differ in more.
    """
    try:
        rigs = attribute_of_each(env, "rig") if isinstance(env, VectorEnv) else []
    except AttributeError:
        rigs = []
    if not rigs or not all(isinstance(rig, Rig) for rig in rigs):
        raise InvalidInput(
            "vector wrappers of CARE-Sim need a vector of its environments, got " + shown(env)
        )
    largest: Rig = max(rigs, key=lambda rig: rig.budget)
    if any(replace(rig, budget=largest.budget) != largest for rig in rigs):
        raise InvalidInput(
            f"the worlds of one vector may differ in the budget of their rigs alone, those of "
            f"{shown(env)} differ in more"
        )
    return largest


def shows_belief(env: gymnasium.Env[Any, Any] | AnyVector) -> bool:
    """Whether observations have the form of CARE-Sim's environments, whatever wrappers did. In a
    vector, those of each world count.
    """
    space = env.single_observation_space if isinstance(env, VectorEnv) else env.observation_space
    return isinstance(space, spaces.Dict) and set(OBSERVED) <= set(space.keys())


class Reading:
    """The beliefs of the observation that a wrapper of `env`, an environment or a vector, was last
    given. Where a wrapper `inside` was given the very same, they are those that it has read.
    """

    def __init__(
        self, env: gymnasium.Env[Any, Any] | AnyVector, rig: Rig, inside: "Reading | None"
    ):
        self._rig = rig
        self._read = Beliefs.from_observation if isinstance(env, VectorEnv) else _read_one
        self._inside = inside
        self._beliefs: Beliefs | None = None

    def take(self, observation: Any) -> None:
        """Read an observation, at once and not when somebody asks: until then it is the caller's,
        who may write into it. Raises InvalidInput for what is none of the rig.
        """
        inside = self._inside
        self._beliefs = self._read(observation, self._rig) if inside is None else inside.beliefs

    @property
    def beliefs(self) -> Beliefs:
        """The last result. Raises gymnasium.error.ResetNeeded before the first reset."""
        if self._beliefs is None:
            raise gymnasium.error.ResetNeeded("call reset() before stepping")
        return self._beliefs


class ReadsBeliefs:
    """A wrapper that reads what it is given."""

    reading: Reading


def _read_one(observation: Observation, rig: Rig) -> Beliefs:
    """The beliefs of the one world of a single environment."""
    return Beliefs.of(rig.read(observation), rig)


def reading_of(env: Any) -> Reading | None:
    """Return the reading of a wrapper, None for anything else."""
    return env.reading if isinstance(env, ReadsBeliefs) else None


def reading_inside(env: Any, what: str) -> Reading:
    """Return the reading of the outermost reading wrapper of an environment or a vector. Raises
    InvalidInput, which says `what` needs it, if there is none.
    """
    layer = env
    while isinstance(layer, gymnasium.Wrapper | VectorWrapper):
        if (found := reading_of(layer)) is not None:
            return found
        layer = layer.env
    raise InvalidInput(
        f"{what} needs the forecasts, and the observation of {shown(env)} does not tell them: put "
        "it inside the wrapper that changes the observation"
    )
