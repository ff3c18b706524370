"""Policies by name: the built-in ones and those that installed packages add
(`care_sim.policies.makers`).
"""

from dataclasses import is_dataclass, replace
from functools import partial
from importlib.metadata import EntryPoint
from typing import Any, TypeAlias, overload

import gymnasium
import gymnasium.vector

from care_sim.base.errors import BrokenPolicy, InvalidInput, shown
from care_sim.base.plugins import Plugins, refuse_link
from care_sim.base.threads import ALONE
from care_sim.base.vectors import attribute_of_each, shared_attribute
from care_sim.policies.base import Policy
from care_sim.policies.controls.patterns import Fan, Place, Rows, Stride, Sweep, TunedPlace
from care_sim.policies.controls.patterns_and_tracks import HistoryPlace, HistoryRows, PlaceHulls
from care_sim.policies.isolation import IsolatedMaker, are_isolated
from care_sim.policies.learned.learned_scorer import LearnedScorer
from care_sim.policies.learned.learned_sets import LearnedSets
from care_sim.policies.learned.ppo import PpoDartoutPolicy, PpoPolicy
from care_sim.policies.makers import (
    PolicyMaker,
    check_parameters,
    is_privileged,
    made,
    policy_faults,
    tags_of_maker,
)
from care_sim.policies.own.boxes import Boxes
from care_sim.policies.own.care import CareSector, CareSightlines, CareSpread
from care_sim.policies.own.care_aimed import CareAimed
from care_sim.policies.own.care_units import CareUnits
from care_sim.policies.paper.blind import BeamReduce, FarthestPoints, Full, Random, RandomPoints
from care_sim.policies.paper.reserves import AllCamera, Care, CarePriority, CareSbf
from care_sim.policies.paper.tracks import History, HistoryOracle, HistoryUniform, Uncertainty
from care_sim.policies.peers.ensemble_variance import AfterGofer
from care_sim.policies.peers.light_curtains import AfterAncha
from care_sim.policies.peers.predicted_regions import AfterShoouri
from care_sim.policies.vector import VectorPolicy, policy_of_rigs

refuse_link(__name__)

__all__ = [
    "BUILT_IN",
    "POLICIES",
    "check_policy",
    "contenders",
    "controls",
    "is_pattern",
    "make_policy",
    "policy_names",
    "tags_of",
]

_AnyEnv: TypeAlias = gymnasium.Env | gymnasium.vector.VectorEnv

BUILT_IN: dict[str, PolicyMaker | EntryPoint] = {
    policy.name: policy
    for policy in (
        Full,
        Random,
        History,
        HistoryUniform,
        Uncertainty,
        BeamReduce,
        AllCamera,
        Care,
        CarePriority,
        CareSbf,
        HistoryOracle,
        RandomPoints,
        FarthestPoints,
        LearnedScorer,
        LearnedSets,
        PpoPolicy,
        PpoDartoutPolicy,
        CareSpread,
        CareSightlines,
        CareSector,
        CareUnits,
        CareAimed,
        AfterShoouri,
        AfterAncha,
        AfterGofer,
        Boxes,
        Rows,
        Fan,
        Stride,
        Sweep,
        Place,
        TunedPlace,
        HistoryRows,
        HistoryPlace,
        PlaceHulls,
    )
}
# Loaded on use, like those of installed packages. They play scenarios themselves, and their traffic
# (highway-env with pandas and Matplotlib) doubles the time of every import.
BUILT_IN |= {
    name: EntryPoint(name, f"care_sim.policies.controls.rehearsed:{made}", "care_sim.policies")
    for name, made in {
        "seed-finder": "SeedFinder",
        "learned-place": "LearnedPlace",
        "history-learned-place": "HistoryLearnedPlace",
    }.items()
}

POLICIES: Plugins[Policy] = Plugins("policy", "care_sim.policies", BUILT_IN, policy_faults)


def policy_names() -> list[str]:
    """Return the names for `make_policy`: the built-in ones, then those of installed packages."""
    return POLICIES.names()


def contenders() -> list[str]:
    """Return the policies that `all` stands for: all but controls."""
    return [name for name in policy_names() if "control" not in tags_of(name)]


def controls() -> list[str]:
    """Return the built-in controls that a car can have: patterns without a camera."""
    return [
        name for name in BUILT_IN if "control" in tags_of(name) and "generator" not in tags_of(name)
    ]


def check_policy(name: str) -> None:
    """Raise InvalidInput for a name that is not a policy."""
    POLICIES.check(name)


def tags_of(name: str) -> tuple[str, ...]:
    """Return the tags of a policy, from `care_sim.policies.base.TAGS`; empty for one that cannot be
    loaded.
    """
    try:
        return tags_of_maker(maker(name))
    except InvalidInput:
        return ()


def is_pattern(name: str) -> bool:
    """Return True if the policy declares that it fires the same under every `cell_order`. False for
    one that cannot be loaded.
    """
    try:
        return bool(getattr(maker(name), "is_pattern", Policy.is_pattern))
    except InvalidInput:
        return False


@overload
def make_policy(
    name: str, env: gymnasium.vector.VectorEnv, /, **parameters: object
) -> VectorPolicy: ...
@overload
def make_policy(name: str, env: gymnasium.Env, /, **parameters: object) -> Policy: ...
def make_policy(name: str, env: _AnyEnv, /, **parameters: object) -> Policy | VectorPolicy:
    """Return a policy for an environment of CARE-Sim, or one for all worlds of a vector
    environment. A privileged policy gets the truth, others only the rig.

    Raises InvalidInput for an unknown name or parameter, or a value that the policy does not allow.
    Raises InvalidInput for an environment without a rig or behind wrappers that change observations
    or actions, and for a privileged policy of many worlds. Raises BrokenPolicy for a policy that
    cannot be loaded or made, MissingExtra for one whose library is not installed.
    """
    check_policy(name)
    try:
        make = maker(name)
    except InvalidInput as error:
        raise BrokenPolicy(f"policy {name} cannot be loaded: {error}") from error
    # Arguments from the environment come first: rig, truth, and the settings in the policy's
    # `told`.
    rigs = _of_environment(name, env, "rig")
    _check_unwrapped(name, env)
    check_parameters(name, make, parameters)
    truth: list[Any] = []
    if is_privileged(make):
        if isinstance(env, gymnasium.vector.VectorEnv):
            raise InvalidInput(
                f"policy {name} is handed the truth of one world: it plays a single environment, "
                "no vector of them"
            )
        truth = _of_environment(name, env, "truth")
    for parameter, setting in getattr(make, "told", Policy.told).items():
        parameters.setdefault(parameter, _setting_of(env, setting))
    makers = [partial(made, name, make, [rig, *truth], parameters) for rig in rigs]
    if isinstance(env, gymnasium.vector.VectorEnv):
        return policy_of_rigs(makers, rigs, getattr(env.unwrapped, "thread_pool", ALONE))
    return makers[0]()


def maker(name: str) -> PolicyMaker:
    """Return the maker of a policy, in its own process if foreign policies are isolated.

    Raises InvalidInput with the reason for one that cannot be loaded.
    """
    if are_isolated() and name not in BUILT_IN:
        return IsolatedMaker(name, maker)
    return POLICIES.maker(name)


def _check_unwrapped(name: str, env: _AnyEnv) -> None:
    # Wrappers that keep both spaces may stay: they watch, or count steps.
    inner = env.unwrapped
    if (env.observation_space, env.action_space) != (inner.observation_space, inner.action_space):
        raise InvalidInput(
            f"policy {name} plays the environment itself, not behind wrappers that change what "
            "is seen or done: give and step env.unwrapped"
        )


def _of_environment(name: str, env: _AnyEnv, attribute: str) -> list[Any]:
    """Return the attribute of an environment, or those of the worlds of a vector."""
    try:
        if isinstance(env, gymnasium.vector.VectorEnv):
            return attribute_of_each(env, attribute)
        return [env.get_wrapper_attr(attribute)]
    except AttributeError as error:
        raise InvalidInput(
            f"policy {name} needs an environment of CARE-Sim with a {attribute}, got {shown(env)}"
        ) from error


def _setting_of(env: _AnyEnv, setting: str) -> object:
    """A setting of the environment, None where the environment has no such setting."""
    if not isinstance(env, gymnasium.vector.VectorEnv):
        value = getattr(env.unwrapped, setting, None)
    else:
        try:
            value = shared_attribute(env, setting)
        except AttributeError:
            return None
    # A foreign scenario may hold more than its fields, such as a world that it built.
    return replace(value) if is_dataclass(value) and not isinstance(value, type) else value
