"""The random streams of the sensors of an episode."""

from typing import NamedTuple

from numpy.random import SeedSequence


class SensorSeeds(NamedTuple):
    """A stream for each sensor: a fault of one leaves the draws of the others as they are."""

    camera: SeedSequence
    lidar: SeedSequence
    odometry: SeedSequence
