"""Seeded scenarios by name. A scenario is a frozen dataclass of its physics with a `build(rng)`."""

from dataclasses import fields

from care_sim.base.checks import check_known
from care_sim.scenarios.base import Scenario
from care_sim.scenarios.cutin import CutIn
from care_sim.scenarios.dartout import Dartout
from care_sim.scenarios.dense import Dense
from care_sim.scenarios.drive import DriveScenario
from care_sim.scenarios.ncap import Ncap
from care_sim.scenarios.r157.scenario import R157

SCENARIOS: dict[str, type[Scenario]] = {
    "dartout": Dartout,
    "dense": Dense,
    "cutin": CutIn,
    "r157": R157,
    "ncap": Ncap,
    "drive": DriveScenario,
}
PAPER_SCENARIOS = ("dartout", "dense", "cutin")
"""The three that stand for the paper's: one encounter on a straight road, by the clock."""


def make_scenario(name: str, /, **parameters: object) -> Scenario:
    """A scenario by name, its physics overridden by `parameters`.

    Raises InvalidInput for an unknown scenario or parameter, or a value out of its domain.
    """
    check_known("scenario", name, SCENARIOS)
    kind = SCENARIOS[name]
    known = [field.name for field in fields(kind)]
    for parameter in parameters:
        check_known(f"parameter of {name}", parameter, known)
    return kind(**parameters)  # type: ignore[arg-type]
