"""What the worlds of a vector environment have alike."""

from typing import Any

from gymnasium.vector import VectorEnv

from care_sim.base.errors import InvalidInput, shown


def shared_attribute(env: VectorEnv[Any, Any, Any], name: str) -> Any:
    """An attribute that a vector environment, whatever wrappers are around it, has for all its
    worlds, or that each of them has.

    Raises AttributeError where there is none, InvalidInput where worlds differ in it.
    """
    inner = env.unwrapped
    # Those of CARE-Sim have one for all; those of Gymnasium ask each world, and say so by a method
    # that the class of all vectors lacks.
    if hasattr(inner, name) or not hasattr(inner, "get_attr"):
        return getattr(inner, name)
    first, *others = inner.get_attr(name)
    if any(other != first for other in others):
        raise InvalidInput(
            f"the worlds of one vector must have one {name}, those of {shown(env)} differ"
        )
    return first
