"""Settings that the worlds of a vector environment share."""

from typing import Any

from gymnasium.vector import VectorEnv

from care_sim.base.errors import InvalidInput, shown


def attribute_of_each(env: VectorEnv[Any, Any, Any], name: str) -> list[Any]:
    """An attribute of each world of a vector environment, whatever wrappers are around it. Raises
    AttributeError where there is none.
    """
    inner = env.unwrapped
    # The class of all vectors lacks the method that those of CARE-Sim and of Gymnasium have.
    if hasattr(inner, "get_attr"):
        return [*inner.get_attr(name)]
    return [getattr(inner, name)] * env.num_envs


def shared_attribute(env: VectorEnv[Any, Any, Any], name: str) -> Any:
    """Return an attribute that all worlds of a vector environment share. Raises AttributeError
    where it is missing, InvalidInput where worlds differ in it.
    """
    first, *others = attribute_of_each(env, name)
    if any(other != first for other in others):
        raise InvalidInput(
            f"the worlds of one vector must have one {name}, those of {shown(env)} differ"
        )
    return first
