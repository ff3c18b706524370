"""What of a policy's arguments a user may set, and what comes from the environment."""

import inspect
from collections.abc import Callable, Mapping
from typing import TypeAlias

from care_sim.base.checks import check_known
from care_sim.base.errors import InvalidInput
from care_sim.policies.base import Policy
from care_sim.policies.privileged import PrivilegedPolicy

PolicyMaker: TypeAlias = Callable[..., Policy]
"""A policy class, or another callable that takes a rig and parameters."""


def is_privileged(make: PolicyMaker) -> bool:
    """Whether truth is handed to it, after the rig."""
    return inspect.isclass(make) and issubclass(make, PrivilegedPolicy)


def settable(make: PolicyMaker) -> list[inspect.Parameter]:
    """The parameters that follow the rig (and the truth)."""
    return list(inspect.signature(make).parameters.values())[_given(make) :]


def check_parameters(name: str, make: PolicyMaker, parameters: Mapping[str, object]) -> None:
    """Raise InvalidInput for a parameter that the policy does not have or that is not the user's to
    set.
    """
    for given in list(inspect.signature(make).parameters)[: _given(make)]:
        if given in parameters:
            raise InvalidInput(
                f"{given} of policy {name} comes from the environment and is no parameter"
            )
    accepted = settable(make)
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in accepted):
        return
    known = [parameter.name for parameter in accepted]
    for parameter in parameters:
        check_known(f"parameter of policy {name}", parameter, known)


def _given(make: PolicyMaker) -> int:
    return 2 if is_privileged(make) else 1
