"""Makers of policies: a `Policy` subclass, or another callable that takes a `Rig` and parameters.

The functions here separate arguments that a user may set from those of the environment. They also
report what is wrong with an entry of the group `care_sim.policies`.
"""

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, TypeAlias

from care_sim.base.checks import check_known
from care_sim.base.errors import BrokenPolicy, InvalidInput, MissingExtra, error_line, shown
from care_sim.base.plugins import class_faults
from care_sim.policies.base import TAGS, TOLD, Policy, PrivilegedPolicy, honest_tags

PolicyMaker: TypeAlias = Callable[..., Policy]
"""A policy class, or another callable that takes a rig and parameters."""


def is_privileged(make: PolicyMaker) -> bool:
    """Return True if the policy gets truth, after the rig."""
    return inspect.isclass(make) and issubclass(make, PrivilegedPolicy)


def settable(make: PolicyMaker) -> list[inspect.Parameter]:
    """Return the parameters after the rig and, for a privileged policy, the truth."""
    return list(inspect.signature(make).parameters.values())[_given(make) :]


def check_parameters(name: str, make: PolicyMaker, parameters: Mapping[str, object]) -> None:
    """Raise InvalidInput for a parameter that the policy does not have or that is not the user's to
    set.
    """
    # The first arguments come only from the environment.
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


def made(
    name: str, make: PolicyMaker, given: Sequence[object], parameters: Mapping[str, object]
) -> Policy:
    """Return the policy that `make` makes. Raises BrokenPolicy for anything else."""
    # Any other error of foreign code is a fault of the policy, and is reported as one.
    try:
        policy = make(*given, **parameters)
    except (KeyboardInterrupt, InvalidInput, MissingExtra):
        raise
    except BaseException as error:
        raise BrokenPolicy(
            f"policy {name} refuses {shown(parameters) if parameters else 'to start'}: "
            f"{error_line(error)}"
        ) from error
    if not isinstance(policy, Policy):
        raise BrokenPolicy(f"policy {name} is no Policy but of type {type(policy).__name__}")
    return policy


def tags_of_maker(make: PolicyMaker) -> tuple[str, ...]:
    """Return the tags of a policy.

    Code that changes the tags of a privileged class later changes nothing.
    """
    tags: tuple[str, ...] = getattr(make, "tags", Policy.tags)
    return honest_tags(tags) if is_privileged(make) else tags


def _given(make: PolicyMaker) -> int:
    """Return the number of arguments from the environment: the rig, and truth for a privileged
    policy.
    """
    return 2 if is_privileged(make) else 1


def policy_faults(made: Any) -> Iterator[str]:
    """Return why a loaded object makes no policy, one text per reason, for
    `care_sim.base.plugins`.
    """
    if not callable(made) or (inspect.isclass(made) and not issubclass(made, Policy)):
        yield "is no Policy"
    yield from class_faults(made)
    try:
        inspect.signature(made)
    except (TypeError, ValueError):
        yield "tells no parameters"
    tags = getattr(made, "tags", TAGS)
    source = getattr(made, "source", "")
    if not (isinstance(tags, tuple) and tags and all(tag in TAGS for tag in tags)):
        yield f"has tags {tags!r}; allowed is a tuple of {', '.join(TAGS)}"
    if not isinstance(source, str):
        yield f"has the source {source!r}; allowed is one line of text"
    told = getattr(made, "told", {})
    if not (isinstance(told, Mapping) and all(setting in TOLD for setting in told.values())):
        yield (
            f"has told {shown(told)}; allowed is a mapping of parameters to {' or '.join(TOLD)}; "
            "a policy that needs the truth derives from care_sim.PrivilegedPolicy"
        )
