"""What became of a threatening collision: avoided, mitigated or hit."""

AVOIDED = "avoided"
"""The car touched nothing."""
MITIGATED = "mitigated"
"""It touched something, and was slower by then than it had come."""
HIT = "hit"
"""It touched something at the speed at which it had come."""
COLLISION_OUTCOMES = (AVOIDED, MITIGATED, HIT)
SAME_SPEED_MPS = 1 / 3.6
"""Within 1 km/h a speed is the same: the tolerance of a test speed in Euro NCAP's protocols."""


def collision_outcome(impact_mps: float | None, approach_mps: float) -> str:
    """One of `COLLISION_OUTCOMES`, from the car's speed at its first contact, None without one, and
    the speed at which it came.
    """
    if impact_mps is None:
        return AVOIDED
    return MITIGATED if impact_mps < approach_mps - SAME_SPEED_MPS else HIT
