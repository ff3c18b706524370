"""The study of the cut-ins of UN Regulation 157: every preventable case of the grid."""

from collections.abc import Sequence
from dataclasses import asdict

from care_sim.core.driver_settings import FIXED
from care_sim.scenarios.r157.grid import CutInCase, kinds_in_turn
from care_sim.scenarios.r157.preventable import preventable
from care_sim.study.episode_config import EpisodeConfig, grid
from care_sim.study.run_config import Row

_POLICIES = ("history", "all-camera", "care", "full")
_BUDGETS = (0.01, 0.03)
"""At 3% a pattern that looks ahead finds as much as a camera (`docs/environments/r157.md`)."""
CASE_COLUMNS = tuple(f"scenario.{name}" for name in CutInCase.__dataclass_fields__)
"""The columns of a case."""


def r157_study(
    seeds: Sequence[int], also: Sequence[str] = (), driver: str = FIXED
) -> list[EpisodeConfig]:
    """Every preventable case of the grid, the kinds and sides in turn, under every policy and
    budget. `also` are further policies, `driver` is that of all.
    """
    policies = list(dict.fromkeys([*_POLICIES, *also]))
    return [
        config
        for case in preventable(kinds_in_turn())
        for config in grid(
            ["r157"],
            policies,
            _BUDGETS,
            seeds,
            scenario_parameters=tuple(asdict(case).items()),
            driver=driver,
        )
    ]


def case_of(row: Row) -> CutInCase:
    """The case that was played."""
    return CutInCase(*(row[column] for column in CASE_COLUMNS))
