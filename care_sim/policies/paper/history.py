"""History-driven scanning: dense on the forecasts of known tracks, sparse elsewhere."""

from care_sim.core.belief import Belief
from care_sim.core.types import Demand
from care_sim.policies.base import Policy


class History(Policy):
    """The base policy of the paper (Sec. 4.1), its re-implementation of history-driven scanning.

    The exploitation sets are the dilated hulls of the forecasts, nearest first. The reserve is
    empty, so the random floor takes what they leave.
    """

    name = "history"
    source = "CARE paper, Sec. 4.1, after adaptive LiDAR scanning (2026)"

    def demand(self, belief: Belief) -> Demand:
        """Hulls of all forecasts."""
        # The tracks of a belief come nearest first, and their hulls keep that order.
        return Demand(self.rig.hulls(belief.tracks.boxes))
