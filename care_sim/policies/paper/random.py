"""The seeded random floor alone."""

from care_sim.core.belief import Belief
from care_sim.core.types import Demand
from care_sim.policies.base import Policy


class Random(Policy):
    """Asks for nothing, so that the shared random floor spends the whole budget."""

    name = "random"
    source = "CARE paper, Sec. 4.1, Algorithm 1 (the floor alone)"

    def demand(self, belief: Belief) -> Demand:
        """Nothing."""
        return Demand()
