"""The studies of the Euro NCAP tests and of the cut-ins of UN Regulation 157."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from care_sim.core.conditions import FIXED
from care_sim.scenarios.ncap.table import TESTS, Across, NcapTest
from care_sim.scenarios.r157 import CutInCase, kinds_in_turn, preventable
from care_sim.study.designs.defaults import (
    NCAP_BUDGETS,
    NCAP_POLICIES,
    NCAP_STEP_KPH,
    R157_BUDGETS,
    R157_POLICIES,
)
from care_sim.study.episode_config import EpisodeConfig, grid, of_cases
from care_sim.study.run_config import Parameters, Row

TEST_COLUMN = "scenario.test"
SPEED_COLUMN = "scenario.speed_kph"
TARGET_COLUMN = "scenario.target_kph"
REPORTED_COLUMN = "scenario.occluder_reported"


@dataclass(frozen=True)
class NcapCase:
    """A test at a pair of speeds. `reported` says whether perception reports the cars that hide the
    target, None where there are none.
    """

    test: str
    ego_kph: float
    target_kph: float
    reported: bool | None

    @property
    def parameters(self) -> Parameters:
        """As parameters of the scenario."""
        given: dict[str, Any] = {
            "test": self.test,
            "speed_kph": self.ego_kph,
            "target_kph": self.target_kph,
        }
        if self.reported is not None:
            given["occluder_reported"] = self.reported
        return tuple(given.items())


def ncap_cases(tests: Sequence[str], step_kph: float) -> list[NcapCase]:
    """The tests at the protocol's speeds that are multiples of `step_kph`. A car that crosses has
    the ego's speed. A test with cars that hide the target comes twice: both readings.
    """
    return [
        NcapCase(name, each.ego_kph, each.target_kph, reported)
        for name in dict.fromkeys(tests)
        for each in TESTS[name].variations
        if each.ego_kph % step_kph == 0
        and (not _car_crosses(TESTS[name]) or each.target_kph == each.ego_kph)
        for reported in ((True, False) if TESTS[name].obstruction else (None,))
    ]


def _car_crosses(test: NcapTest) -> bool:
    return isinstance(test.way, Across) and not test.way.run_up_m


def ncap_study(
    seeds: Sequence[int],
    policies: Sequence[str] = NCAP_POLICIES,
    tests: Sequence[str] = tuple(TESTS),
    budgets: Sequence[float] = NCAP_BUDGETS,
    step_kph: float = NCAP_STEP_KPH,
    **common: Any,
) -> list[EpisodeConfig]:
    """Every case, policy and budget: 140 cases, 2,240 configurations a seed by default. `common`
    are further fields of `EpisodeConfig`.
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
    """The preventable cases of the grid, the kinds and sides in turn, or one of `every` of them,
    under every policy and budget. `driver` is that of all.
    """
    # The cases are the grid's own, which need no check: policies and budgets are checked once.
    cases = [tuple(asdict(case).items()) for case in _some(preventable(kinds_in_turn()), every)]
    return of_cases(grid(["r157"], policies, budgets, seeds, driver=driver), cases)


def _some(cases: Sequence[CutInCase], every: int) -> list[CutInCase]:
    """One case of `every`, in their order."""
    # By lot, the same at every call: kinds and sides come in turn, and every fifth case would be
    # of nearly one kind.
    lot = np.random.default_rng(0).permutation(len(cases))
    return [cases[number] for number in sorted(lot[::every].tolist())]


def case_of(row: Row) -> CutInCase:
    """The case that was played."""
    return CutInCase(*(row[column] for column in CASE_COLUMNS))
