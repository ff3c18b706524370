"""History-driven scanning: dense on the forecasts of known tracks, sparse elsewhere."""

from care_sim.core.beliefs import Beliefs
from care_sim.core.world_sets import WorldSets
from care_sim.policies.base import RowPolicy


class History(RowPolicy):
    """The base policy of the paper (Sec. 4.1), its re-implementation of history-driven scanning.

    The exploitation sets are the dilated hulls of the forecasts, nearest first. The reserve is
    empty, so the random floor takes what they leave.
    """

    name = "history"
    source = "CARE paper, Sec. 4.1, after adaptive LiDAR scanning (2026)"

    def stages(self, beliefs: Beliefs) -> list[WorldSets]:
        """Hulls of all forecasts."""
        return [beliefs.hulls]
