"""An episode of the closed loop: its random streams, what it begins with, and how long it lasts."""

import math
from typing import NamedTuple

from numpy.random import SeedSequence

from care_sim.base.seeds import streams
from care_sim.base.times import LAST_BITS_S
from care_sim.sensors.false_boxes import EMPTY_POOL, BoxPool
from care_sim.world.world import World


class SensorSeeds(NamedTuple):
    """A stream for each sensor: a fault of one leaves the draws of the others as they are."""

    camera: SeedSequence
    lidar: SeedSequence
    odometry: SeedSequence
    detector: SeedSequence


class EpisodeSeeds(NamedTuple):
    """The streams that the seed of an episode holds: of the scenario, the sensors, the floor, and
    of another drive through the scenario, from which false boxes are drawn. The other drive reveals
    nothing about the episode.
    """

    scenario: SeedSequence
    sensors: SensorSeeds
    floor: SeedSequence
    another: SeedSequence

    @classmethod
    def of(cls, entropy: int, secret: str = "") -> "EpisodeSeeds":
        """Return the streams of a seed; see `care_sim.base.seeds`."""
        # Their order is a part of what a seed means.
        scenario, camera, lidar, floor, odometry, another, detector = streams((entropy,), 7, secret)
        return cls(scenario, SensorSeeds(camera, lidar, odometry, detector), floor, another)


class Episode(NamedTuple):
    """A world at time zero, the random streams of the sensors, that of the floor, and the boxes
    that false ones are drawn from.
    """

    world: World
    seeds: SensorSeeds
    floor: SeedSequence
    pool: BoxPool = EMPTY_POOL


def most_keyframes(duration_s: float, keyframe_s: float) -> int:
    """Keyframes of an episode of `duration_s` seconds, which ends with a whole one."""
    return math.ceil((duration_s - LAST_BITS_S) / keyframe_s)
