"""What the wrappers of vector environments ask of what they wrap."""

from dataclasses import replace
from typing import Any

from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper

from care_sim.base.errors import InvalidInput, shown
from care_sim.base.vectors import attribute_of_each
from care_sim.core.belief import OBSERVED
from care_sim.core.rig import Rig

AnyVector = VectorEnv[Any, Any, Any]


class WorldsWrapper(VectorWrapper[Any, Any, Any, Any, Any]):
    """A wrapper of a vector environment."""

    @property
    def autoreset_mode(self) -> AutoresetMode:
        """Where Gymnasium's own vector environments tell it, too; TorchRL asks for it there."""
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


def shows_beliefs(env: AnyVector) -> bool:
    """Whether observations have the form of CARE-Sim's environments, whatever wrappers did."""
    space = env.single_observation_space
    return isinstance(space, spaces.Dict) and set(OBSERVED) <= set(space.keys())
