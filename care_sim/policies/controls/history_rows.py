"""A control: history with its reserve on the pattern `rows`, without a camera."""

from care_sim.core.belief import Belief
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import Policy
from care_sim.policies.controls.rows import nearest_rows


class HistoryRows(Policy):
    """The hulls of the history policy; the reserve goes to the rows at which things enter the
    range. What CARE must beat to show that its camera matters.
    """

    name = "history-rows"
    tags = ("causal", "control")
    source = "own: history, and a pattern that never changes"
    keeps_order = True

    def __init__(self, rig: Rig):
        super().__init__(rig)
        self._rows = nearest_rows(rig.grid)

    def demand(self, belief: Belief) -> Demand:
        """Hulls, then rows."""
        hulls = self.rig.listed(self.rig.hulls(belief.tracks.boxes))
        return Demand(hulls, [[self._rows[: belief.budget]]])
