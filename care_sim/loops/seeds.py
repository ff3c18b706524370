"""The random streams of an episode of the closed loop."""

from typing import NamedTuple

from numpy.random import SeedSequence

from care_sim.base.seeds import streams


class SensorSeeds(NamedTuple):
    """A stream for each sensor: a fault of one leaves the draws of the others as they are."""

    camera: SeedSequence
    lidar: SeedSequence
    odometry: SeedSequence


class EpisodeSeeds(NamedTuple):
    """The streams that the seed of an episode holds: of the scenario, the sensors, the floor, and
    of another drive through the scenario, from which false boxes are drawn. Nothing in that one
    tells of the episode.
    """

    scenario: SeedSequence
    sensors: SensorSeeds
    floor: SeedSequence
    another: SeedSequence

    @classmethod
    def of(cls, entropy: int, secret: str = "") -> "EpisodeSeeds":
        """Those of a seed; see `care_sim.base.seeds`."""
        # Their order is a part of what a seed means.
        scenario, camera, lidar, floor, odometry, another = streams((entropy,), 6, secret)
        return cls(scenario, SensorSeeds(camera, lidar, odometry), floor, another)
