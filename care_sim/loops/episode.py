"""What an episode of the closed loop begins with."""

from typing import NamedTuple

from numpy.random import SeedSequence

from care_sim.loops.seeds import SensorSeeds
from care_sim.world.world import World


class Episode(NamedTuple):
    """A world at time zero, the random streams of the sensors, and that of the floor."""

    world: World
    seeds: SensorSeeds
    floor: SeedSequence
