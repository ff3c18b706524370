"""An episode of the closed loop: what it begins with, and how long it lasts."""

import math
from typing import NamedTuple

from numpy.random import SeedSequence

from care_sim.base.times import LAST_BITS_S
from care_sim.loops.seeds import SensorSeeds
from care_sim.world.world import World


class Episode(NamedTuple):
    """A world at time zero, the random streams of the sensors, and that of the floor."""

    world: World
    seeds: SensorSeeds
    floor: SeedSequence


def most_keyframes(duration_s: float, keyframe_s: float) -> int:
    """Keyframes of an episode of `duration_s` seconds, which ends with a whole one."""
    return math.ceil((duration_s - LAST_BITS_S) / keyframe_s)
