"""The study of crowding: the dense street with more and more standing vehicles."""

from collections.abc import Sequence

from care_sim.scenarios.dartout import VEHICLE_PLACES
from care_sim.study.episode_config import EpisodeConfig, grid

_CROWDING_BUDGETS = (0.01, 0.02, 0.03, 0.04, 0.05, 0.10, 0.20, 0.35)
_VEHICLE_COUNTS = range(len(VEHICLE_PLACES) + 1)
CROWDING_POLICIES = ("all-camera", "care", "full")
VEHICLES_COLUMN = "scenario.vehicles"
"""The column that the study varies."""


def crowding_study(seeds: Sequence[int], also: Sequence[str] = ()) -> list[EpisodeConfig]:
    """The dense street with 0 to 12 standing vehicles, at eight budgets from 1 to 35%: 221
    configurations a seed.

    `also` are further policies.
    """
    policies = list(dict.fromkeys([*CROWDING_POLICIES, *also]))
    return [
        config
        for vehicles in _VEHICLE_COUNTS
        for config in grid(
            ["dense"],
            policies,
            _CROWDING_BUDGETS,
            seeds,
            scenario_parameters=(("vehicles", vehicles),),
        )
    ]
