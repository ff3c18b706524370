"""What the wrappers of vector environments ask of what they wrap."""

from typing import Any

from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper

from care_sim.base.errors import InvalidInput, shown
from care_sim.base.vectors import shared_attribute
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
    environments of CARE-Sim. Raises InvalidInput for another, and for worlds of several rigs.
    """
    try:
        rig = shared_attribute(env, "rig") if isinstance(env, VectorEnv) else None
    except AttributeError:
        rig = None
    if not isinstance(rig, Rig):
        raise InvalidInput(
            "vector wrappers of CARE-Sim need a vector of its environments, got " + shown(env)
        )
    return rig


def shows_beliefs(env: AnyVector) -> bool:
    """Whether observations have the form of CARE-Sim's environments, whatever wrappers did."""
    space = env.single_observation_space
    return isinstance(space, spaces.Dict) and set(OBSERVED) <= set(space.keys())
