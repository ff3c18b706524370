"""What the wrappers of vector environments ask of what they wrap."""

from typing import Any

from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper

from care_sim.base.errors import InvalidInput, shown
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
    inner = env.unwrapped if isinstance(env, VectorEnv) else None
    rigs = [inner.rig] if hasattr(inner, "rig") else _rigs_of_each(inner)
    if not rigs or not all(isinstance(rig, Rig) for rig in rigs):
        raise InvalidInput(
            "vector wrappers of CARE-Sim need a vector of its environments, got " + shown(env)
        )
    if any(rig != rigs[0] for rig in rigs):
        raise InvalidInput(f"the worlds of one vector must have one rig, those of {env} differ")
    first: Rig = rigs[0]
    return first


def shows_beliefs(env: AnyVector) -> bool:
    """Whether observations have the form of CARE-Sim's environments, whatever wrappers did."""
    space = env.single_observation_space
    return isinstance(space, spaces.Dict) and set(OBSERVED) <= set(space.keys())


def _rigs_of_each(inner: Any) -> list[Any]:
    try:
        return list(inner.get_attr("rig"))
    except AttributeError:
        return []
