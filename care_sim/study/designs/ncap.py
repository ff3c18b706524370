"""The study of the Euro NCAP tests: test by speed by policy by budget."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from care_sim.scenarios.ncap.table import TESTS, Across, NcapTest
from care_sim.study.designs.defaults import NCAP_BUDGETS, NCAP_POLICIES, NCAP_STEP_KPH
from care_sim.study.episode_config import EpisodeConfig, grid, of_cases
from care_sim.study.parameters import Parameters

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
