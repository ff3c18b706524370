"""The seeded random floor alone."""

from care_sim.core.types import Demand
from care_sim.policies.base import FixedPolicy


class Random(FixedPolicy):
    """Asks for nothing, so that the shared random floor spends the whole budget."""

    name = "random"
    source = "CARE paper, Sec. 4.1, Algorithm 1 (the floor alone)"

    def fixed(self, budget: int) -> Demand:
        """Nothing."""
        return Demand()
