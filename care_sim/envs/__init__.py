"""Gymnasium environments; importing `care_sim` registers them, and those of installed scenarios."""

from importlib.metadata import entry_points
from typing import Any

import gymnasium
from gymnasium.envs.registration import EnvSpec

from care_sim.base.checks import check_known
from care_sim.base.plugins import (
    SCENARIO_GROUP,
    is_environment_id,
    is_place,
    refuse_link,
    scenario_of,
)

refuse_link(__name__)

CLOSED_LOOP = {
    "CARE-Dartout-v0": "care_sim.envs.scenarios:DartoutEnv",
    "CARE-Dense-v0": "care_sim.envs.scenarios:DenseEnv",
    "CARE-CutIn-v0": "care_sim.envs.scenarios:CutInEnv",
    "CARE-R157-v0": "care_sim.envs.scenarios:R157Env",
    "CARE-NCAP-v0": "care_sim.envs.scenarios:NcapEnv",
    "CARE-Drive-v0": "care_sim.envs.scenarios:DriveEnv",
}
OPEN_LOOP = {
    "CARE-Street-v0": "care_sim.envs.scenes:StreetEnv",
    "CARE-Replay-v0": "care_sim.envs.scenes:ReplayEnv",
}
IDS = CLOSED_LOOP | OPEN_LOOP
"""Entry points of all environments of CARE-Sim, by id."""
ENVIRONMENT_IDS = {scenario_of(name): name for name in CLOSED_LOOP}
"""The id of every built-in scenario's environment."""
_ANY_SCENARIO = "care_sim.envs.scenarios:ScenarioEnv"


def installed_ids() -> list[str]:
    """The ids of the environments of installed scenarios, in alphabetical order."""
    return sorted({*filter(is_environment_id, _installed())} - {*IDS})


def register_all() -> None:
    """Register every environment that is not registered yet."""
    # As strings: an environment and what it needs are imported when one is made.
    for name in [*IDS, *installed_ids()]:
        if name not in gymnasium.registry:
            entry_point = IDS.get(name, _ANY_SCENARIO)
            gymnasium.register(
                name,
                entry_point=entry_point,
                vector_entry_point=_vector_of(entry_point),
                kwargs={} if name in IDS else {"scenario": name},
            )


def make_env(name: str, **arguments: Any) -> gymnasium.Env[Any, Any]:
    """The environment of an id, of CARE-Sim or of an installed scenario, or else of a scenario by
    name or place, without Gymnasium's checker. Raises InvalidInput for any other name.
    """
    # Looking up what is installed takes 20 ms, and training makes environments for every episode.
    if name not in [*IDS]:
        scenarios = [*ENVIRONMENT_IDS, *map(scenario_of, _installed())]
        if isinstance(name, str) and (is_place(name) or name in scenarios):
            return make_scenario_env(name, **arguments)
        check_known("environment", name, [*IDS, *installed_ids()])
    return gymnasium.make(f"care_sim:{name}", disable_env_checker=True, **arguments)


def make_scenario_env(scenario: str, **arguments: Any) -> gymnasium.Env[Any, Any]:
    """The environment of a scenario by name or place, without Gymnasium's checker."""
    known = ENVIRONMENT_IDS.get(scenario)
    # Another scenario needs no registration: workers make it by its name alone.
    any_other = EnvSpec("CARE-Scenario-v0", _ANY_SCENARIO, kwargs={"scenario": scenario})
    spec = f"care_sim:{known}" if known else any_other
    return gymnasium.make(spec, disable_env_checker=True, **arguments)


def _installed() -> list[str]:
    """The names of the entries of installed scenarios."""
    return [entry.name for entry in entry_points(group=SCENARIO_GROUP)]


def _vector_of(entry_point: str) -> str | None:
    """The entry point of many worlds at once of an environment; None of the open loop."""
    place, _, kind = entry_point.partition(":")
    if place != "care_sim.envs.scenarios":
        return None
    return f"care_sim.envs.vector.env:{kind.removesuffix('Env')}VectorEnv"
