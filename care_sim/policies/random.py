"""The seeded random floor alone."""

from care_sim.policies.base import Policy
from care_sim.types import Belief, Demand


class Random(Policy):
    """Asks for nothing, so that the shared random floor spends the whole budget."""

    name = "random"

    def demand(self, belief: Belief) -> Demand:
        """Nothing."""
        return Demand()
