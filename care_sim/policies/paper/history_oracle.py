"""History with perfect forecasts: the true next poses of everything tracked."""

import numpy as np

from care_sim.core.belief import Belief
from care_sim.core.boxes import planar_ranges
from care_sim.core.types import Demand
from care_sim.policies.base import PrivilegedPolicy


class HistoryOracle(PrivilegedPolicy):
    """The oracle of the paper (Sec. 5.2): history with the true next positions of tracked objects.

    They replace the forecasts. It bounds any learned predictor of regions from above. New objects
    stay unknown to it.
    """

    name = "history-oracle"
    source = "CARE paper, Sec. 5.2 (oracle variant)"

    def demand(self, belief: Belief) -> Demand:
        """Hulls of the true boxes, nearest first."""
        boxes = self.truth.boxes(belief.tracks)
        # True places may be in another order than the forecasts were; equal ones keep theirs.
        nearest_first = np.argsort(planar_ranges(boxes), kind="stable")
        return Demand(self.rig.hulls(boxes[nearest_first]))
