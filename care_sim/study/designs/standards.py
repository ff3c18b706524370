"""The studies of the Euro NCAP tests and of the cut-ins of UN Regulation 157."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from care_sim.core.conditions import FIXED
from care_sim.scenarios.ncap.table import TESTS, Across
from care_sim.scenarios.r157 import CutInCase, kinds_in_turn, preventable
from care_sim.study.designs.defaults import (
    NCAP_BUDGETS,
    NCAP_POLICIES,
    NCAP_STEP_KPH,
    R157_BUDGETS,
    R157_POLICIES,
)
from care_sim.study.episode_config import EpisodeConfig, grid, of_cases
from care_sim.study.rows.parameters import Parameters
from care_sim.study.run_config import Row

TEST_COLUMN = "scenario.test"
SPEED_COLUMN = "scenario.speed_kph"
TARGET_COLUMN = "scenario.target_kph"
REPORTED_COLUMN = "scenario.occluder_reported"
_CROSSED_BY_CARS = {
    name for name, test in TESTS.items() if isinstance(test.way, Across) and not test.way.run_up_m
}


@dataclass(frozen=True)
class NcapCase:
    """A test at a pair of speeds. `reported` is True if perception reports the cars that hide the
    target, None without such cars.
    """

    test: str
    ego_kph: float
    target_kph: float
    reported: bool | None

    @property
    def parameters(self) -> Parameters:
        """Return the case as parameters of the scenario."""
        given: dict[str, Any] = {
            "test": self.test,
            "speed_kph": self.ego_kph,
            "target_kph": self.target_kph,
        }
        if self.reported is not None:
            given["occluder_reported"] = self.reported
        return tuple(given.items())


def ncap_cases(tests: Sequence[str], step_kph: float) -> list[NcapCase]:
    """Return the tests at the protocol's speeds that are multiples of `step_kph`. A crossing car
    has the ego's speed. A test with cars that hide the target comes twice: reported and not.
    """
    return [
        NcapCase(name, each.ego_kph, each.target_kph, reported)
        for name in dict.fromkeys(tests)
        for each in TESTS[name].variations
        if each.ego_kph % step_kph == 0
        and (name not in _CROSSED_BY_CARS or each.target_kph == each.ego_kph)
        for reported in ((True, False) if TESTS[name].obstruction else (None,))
    ]


def ncap_study(
    seeds: Sequence[int],
    policies: Sequence[str] = NCAP_POLICIES,
    tests: Sequence[str] = tuple(TESTS),
    budgets: Sequence[float] = NCAP_BUDGETS,
    step_kph: float = NCAP_STEP_KPH,
    **common: Any,
) -> list[EpisodeConfig]:
    """Return every case, policy and budget: by default 140 cases, 2,240 configurations per seed.
    `common` are further fields of `EpisodeConfig`.
    """
    # The cases are the protocols' own, which need no check: policies and budgets are checked once.
    cases = [case.parameters for case in ncap_cases(tests, step_kph)]
    return of_cases(grid(["ncap"], policies, budgets, seeds, **common), cases)


CASE_COLUMNS = tuple(f"scenario.{name}" for name in CutInCase.__dataclass_fields__)
"""The columns of a case."""


def r157_study(
    seeds: Sequence[int],
    policies: Sequence[str] = R157_POLICIES,
    budgets: Sequence[float] = R157_BUDGETS,
    every: int = 1,
    driver: str = FIXED,
) -> list[EpisodeConfig]:
    """Return the preventable cases of the grid, kinds and sides in turn, or one of `every` of them,
    under every policy and budget. `driver` is the driver of all.
    """
    cases = preventable(kinds_in_turn())
    # Drawn at random, the same at every call: kinds and sides come in turn, so every fifth case
    # would be of nearly one kind.
    lot = np.random.default_rng(0).permutation(len(cases))
    some = [tuple(asdict(cases[number]).items()) for number in sorted(lot[::every].tolist())]
    # The cases are the grid's own, which need no check: policies and budgets are checked once.
    return of_cases(grid(["r157"], policies, budgets, seeds, driver=driver), some)


def case_of(row: Row) -> CutInCase:
    """Return the case of a row."""
    return CutInCase(*(row[column] for column in CASE_COLUMNS))
