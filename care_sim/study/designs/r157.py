"""The study of the cut-ins of UN Regulation 157: every preventable case of the grid."""

from collections.abc import Sequence
from dataclasses import asdict

import numpy as np

from care_sim.core.driver_settings import FIXED
from care_sim.scenarios.r157 import CutInCase, kinds_in_turn, preventable
from care_sim.study.designs.defaults import R157_BUDGETS, R157_POLICIES
from care_sim.study.episode_config import EpisodeConfig, grid, of_cases
from care_sim.study.run_config import Row

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
