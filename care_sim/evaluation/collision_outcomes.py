"""What became of a threatening collision: avoided, mitigated or hit."""

from enum import StrEnum

SAME_SPEED_MPS = 1 / 3.6
"""Within 1 km/h a speed is the same: the tolerance of a test speed in Euro NCAP's protocols."""


class CollisionOutcome(StrEnum):
    """How it ended."""

    AVOIDED = "avoided"
    MITIGATED = "mitigated"
    HIT = "hit"


def collision_outcome(impact_mps: float | None, unbraked_mps: float) -> CollisionOutcome:
    """How it ended, from the speed of the impact, None without one, and that at which a car hits
    that does not brake.
    """
    if impact_mps is None:
        return CollisionOutcome.AVOIDED
    slower = impact_mps < unbraked_mps - SAME_SPEED_MPS
    return CollisionOutcome.MITIGATED if slower else CollisionOutcome.HIT
