"""Seeded scenarios by name: the built-in ones, those that installed packages add, and any class by
its place. A scenario is a frozen dataclass of its physics with a `build(rng)`.

An entry of the group `care_sim.scenarios` names the class. It is called as the scenario is, or by
the id of its environment, which is then registered (`care_sim.base.plugins`).
"""

from dataclasses import fields

from care_sim.base.checks import check_known
from care_sim.base.errors import BrokenScenario, InvalidInput, error_line, shown
from care_sim.base.plugins import SCENARIO_GROUP, Plugins, refuse_link, scenario_of
from care_sim.scenarios.base import Scenario, scenario_faults
from care_sim.scenarios.cutin import CutIn
from care_sim.scenarios.dartout import Dartout, Dense
from care_sim.scenarios.drive import DriveScenario
from care_sim.scenarios.ncap import Ncap
from care_sim.scenarios.r157 import R157

refuse_link(__name__)

SCENARIOS: dict[str, type[Scenario]] = {
    "dartout": Dartout,
    "dense": Dense,
    "cutin": CutIn,
    "r157": R157,
    "ncap": Ncap,
    "drive": DriveScenario,
}
"""The built-in ones."""
PLUGINS: Plugins[Scenario] = Plugins(
    "scenario", SCENARIO_GROUP, SCENARIOS, scenario_faults, scenario_of
)
PAPER_SCENARIOS = ("dartout", "dense", "cutin")
"""The three that stand for the paper's: one encounter on a straight road, by the clock."""


def scenario_names() -> list[str]:
    """The built-in names, then those of installed packages."""
    return PLUGINS.names()


def scenario_class(scenario: str | type[Scenario], /) -> type[Scenario]:
    """The class of a scenario by name or place; a class is itself.

    Raises InvalidInput for an unknown name; BrokenScenario, with the reason, for what cannot be
    loaded or is no scenario.
    """
    if not isinstance(scenario, str):
        for fault in scenario_faults(scenario):
            raise BrokenScenario(f"{shown(scenario)} {fault}")
        return scenario
    PLUGINS.check(scenario)
    try:
        kind = PLUGINS.maker(scenario)
    except InvalidInput as error:
        raise BrokenScenario(f"scenario {scenario} cannot be loaded: {error}") from error
    return kind  # type: ignore[return-value]  # a class, as `scenario_faults` has it


def make_scenario(scenario: str | type[Scenario], /, **parameters: object) -> Scenario:
    """A scenario by name, place or class, its physics overridden by `parameters`.

    Raises InvalidInput for an unknown scenario or parameter, or a value out of its domain;
    BrokenScenario for one that cannot be loaded or made.
    """
    kind = scenario_class(scenario)
    name = scenario if isinstance(scenario, str) else kind.__name__
    known = [field.name for field in fields(kind)]
    for parameter in parameters:
        check_known(f"parameter of {name}", parameter, known)
    try:
        return kind(**parameters)  # type: ignore[arg-type]
    except (KeyboardInterrupt, InvalidInput):
        raise
    # Foreign code may raise anything; some leaves by `sys.exit`.
    except BaseException as error:
        refused = shown(parameters) if parameters else "to start"
        raise BrokenScenario(f"scenario {name} refuses {refused}: {error_line(error)}") from error
