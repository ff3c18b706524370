"""Policies by name: the built-in ones and those that installed packages add.

A package adds one through the entry-point group `care_sim.policies`: the entry's name is the policy's,
its object a `Policy` subclass (or any callable taking a `Rig` and parameters).
"""

import inspect
from collections.abc import Callable, Mapping
from importlib import metadata

import gymnasium

from care_sim.errors import InvalidInput, unknown
from care_sim.policies.all_camera import AllCamera
from care_sim.policies.base import Policy
from care_sim.policies.care import Care
from care_sim.policies.care_sbf import CareSbf
from care_sim.policies.full import Full
from care_sim.policies.history import History
from care_sim.policies.random import Random

ENTRY_POINTS = "care_sim.policies"
BUILT_IN: dict[str, Callable[..., Policy]] = {
    policy.name: policy for policy in (Full, Random, History, AllCamera, Care, CareSbf)
}


def policy_names() -> list[str]:
    """Names that `make_policy` knows: the built-in ones, then those of installed packages."""
    return [*BUILT_IN, *sorted(set(_installed().names) - set(BUILT_IN))]


def check_policy(name: str) -> None:
    """Raise InvalidInput for a name that is not a policy."""
    if name not in BUILT_IN and name not in policy_names():
        raise unknown("policy", name, policy_names())


def make_policy(name: str, env: gymnasium.Env, **parameters: object) -> Policy:
    """A policy for an environment of CARE-Sim.

    Raises InvalidInput for an unknown name or parameter, an environment without a rig, or one that the
    policy refuses.
    """
    check_policy(name)
    try:
        rig = env.get_wrapper_attr("rig")
    except AttributeError as error:
        raise InvalidInput(f"policy {name} needs an environment of CARE-Sim, got {env}") from error
    make = BUILT_IN[name] if name in BUILT_IN else _load(_installed()[name])
    _check_parameters(name, make, parameters)
    try:
        return make(rig, **parameters)
    except InvalidInput:
        raise
    except (TypeError, ValueError) as error:
        raise InvalidInput(f"policy {name} refuses {parameters}: {error}") from error


def _load(entry: metadata.EntryPoint) -> Callable[..., Policy]:
    try:
        make: Callable[..., Policy] = entry.load()
    except Exception as error:
        raise InvalidInput(f"policy {entry.name} ({entry.value}) cannot be loaded: {error}") from error
    return make


def _check_parameters(name: str, make: Callable[..., Policy], parameters: Mapping[str, object]) -> None:
    rig, *accepted = inspect.signature(make).parameters.values()
    if rig.name in parameters:
        raise InvalidInput(f"{rig.name} of policy {name} comes from the environment and is no parameter")
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in accepted):
        return
    for parameter in parameters:
        if parameter not in [known.name for known in accepted]:
            raise unknown(f"parameter of policy {name}", parameter, [known.name for known in accepted])


def _installed() -> metadata.EntryPoints:
    return metadata.entry_points(group=ENTRY_POINTS)
