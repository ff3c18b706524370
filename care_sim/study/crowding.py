"""Where the all-camera reserve collapses as the number of tracked vehicles in the dense street grows."""

from collections.abc import Sequence

from care_sim.scenarios.dense import PLACES, Dense
from care_sim.study.config import EpisodeConfig, grid
from care_sim.study.episode import Row

BUDGETS = (0.02, 0.03, 0.04, 0.05)
VEHICLES = range(len(PLACES) + 1)
POLICIES = ("all-camera", "care", "full")
COLUMN = "scenario.vehicles"
"""The column of the rows that the study varies."""


def vehicles_of(row: Row) -> int:
    """Standing vehicles in an episode of the dense street; the scenario's own number where the row names none."""
    vehicles = row.get(COLUMN)
    return Dense.vehicles if vehicles is None else int(vehicles)


def configurations(seeds: Sequence[int]) -> list[EpisodeConfig]:
    """The dense street with 0 to 12 standing vehicles, at 2, 3, 4 and 5%: 117 configurations a seed."""
    return [
        config
        for vehicles in VEHICLES
        for config in grid(["dense"], POLICIES, BUDGETS, seeds, scenario_parameters=(("vehicles", vehicles),))
    ]
