"""A control: every so manyth cell of the grid, without camera, tracks or memory."""

from care_sim.core.types import Demand
from care_sim.policies.base import FixedPolicy
from care_sim.policies.paper.history_uniform import uniform_pattern


class Stride(FixedPolicy):
    """Spends the whole budget on one even pattern over all the grid: what `history-uniform` does
    with the reserve.
    """

    name = "stride"
    tags = ("causal", "control")
    source = "own: a pattern that never changes"
    is_pattern = True

    def fixed(self, budget: int) -> Demand:
        """The pattern of the budget."""
        return Demand(layers=[[uniform_pattern(self.rig.grid, budget)]])
