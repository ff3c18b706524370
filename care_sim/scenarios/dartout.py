"""Dart-out: a person runs out from behind a parked trailer into an empty street.

All its numbers are in `care_sim.scenarios.crossing`.
"""

from dataclasses import dataclass

import numpy as np

from care_sim.scenarios.crossing import CrossingScenario
from care_sim.world.world import World


@dataclass(frozen=True)
class Dartout(CrossingScenario):
    """The street of `CrossingScenario`, with nobody else in it."""

    def furnish(self, world: World, crossing_x: float, rng: np.random.Generator) -> None:
        """Leave the street empty."""
