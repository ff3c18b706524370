"""`care-sim ncap`: the Euro NCAP tests, scored."""

from dataclasses import dataclass
from typing import Annotated

import tyro

from care_sim.base.bounds import bounded
from care_sim.base.checks import check_known
from care_sim.base.errors import InvalidInput
from care_sim.commands.shared.episode_studies import EpisodeStudy
from care_sim.commands.shared.options import DEFAULT_SENSING, SensingOptions, seeds_of
from care_sim.commands.shared.selection import check_values, expanded, playable
from care_sim.scenarios.ncap.table import TESTS
from care_sim.study.designs.ncap import (
    NCAP_BUDGETS,
    NCAP_POLICIES,
    NCAP_STEP_KPH,
    ncap_cases,
    ncap_study,
)
from care_sim.study.episode_config import grid


@dataclass(frozen=True, kw_only=True)
class Ncap(EpisodeStudy):
    """Play the Euro NCAP tests: avoided, mitigated or hit; a score.

    Play the Euro NCAP tests of emergency braking: avoided, mitigated or hit, and a score.
    """

    seeds: tuple[int, ...] = (10,)
    """One number: that many seeds, from 0. Several numbers: these seeds, of one split; 7 7 is seed
    7 alone.
    """
    tests: tuple[str, ...] = ("all",)
    """Names of tests, as on the page of CARE-NCAP-v0; `all` stands for all of them."""
    policies: tuple[str, ...] = NCAP_POLICIES
    """Names of `care-sim policies`; `all` stands for all but the controls. `full` always runs with
    budget 1.0."""
    budgets: tuple[float, ...] = NCAP_BUDGETS
    """Shares of the cells that may fire at a keyframe, above 0 and at most 1."""
    step_kph: float = bounded(NCAP_STEP_KPH, 5, 50)
    """Plays the protocols' speeds that are multiples of this; 5 plays them all."""
    conditions: Annotated[SensingOptions, tyro.conf.arg(name="")] = DEFAULT_SENSING
    """Conditions that all episodes share."""

    def __call__(self) -> int:
        """Run it."""
        check_values(self, "tests", "policies", "budgets", "seeds")
        tests = expanded(self.tests, TESTS)
        for name in tests:
            check_known("test", name, TESTS)
        if not ncap_cases(tests, self.step_kph):
            raise InvalidInput(f"no speed of these tests is a multiple of {self.step_kph:g} km/h")
        common = self.conditions.sensing()
        policies, left_out = playable(
            self.policies, lambda name: grid(["ncap"], [name], self.budgets[:1], [0], **common)
        )
        if not policies:
            raise InvalidInput("none of the policies can be played")
        seeds = seeds_of(self.seeds)
        configs = ncap_study(seeds, policies, tests, self.budgets, self.step_kph, **common)
        return self.play_study("ncap", configs, "ncap", left_out)
