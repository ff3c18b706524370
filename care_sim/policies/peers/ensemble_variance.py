"""Rays where predictions of depth disagree, after Gofer et al., TIP 2021."""

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.belief import Belief
from care_sim.core.grid import Head
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import Policy

MEMBERS = 5
"""Predictions that are compared."""
MEMORY_S = 1.0
"""Time for which a measured range counts as known, seconds."""
LEAST_M2 = 1e-4
"""Weight, square metres, that every cell has beside its variance, so that all can be drawn."""


class AfterGofer(Policy):
    """Sample with a probability proportional to the variance of an ensemble's predicted depths.

    The paper (arXiv 2007.13834) completes the depth of one picture in several phases. It fires some
    pixels and lets an ensemble of learners predict the others. The pixels of the next phase are
    drawn in proportion to the variance of the predictions.

    Differences here: a mask is fixed before anything returns, so a phase is a keyframe, and the
    ranges of the last second are known. A member knows a random half of them and predicts the
    nearest one in the image; the paper's members are trained. There is no picture. Draws depend
    only on the number of the keyframe. A line without a return has the range of the grid. Ranges
    stay in their cells while the car moves, and the image ends straight behind the car.
    """

    name = "after-gofer"
    source = "after Gofer et al., Adaptive LiDAR Sampling, TIP 2021, arXiv 2007.13834"
    is_pattern = True

    def __init__(self, rig: Rig):
        super().__init__(rig)
        self._keyframes = max(round(MEMORY_S / rig.keyframe_s), 1)
        self.reset()

    def reset(self) -> None:
        """Forget measured ranges."""
        self._ranges = np.zeros(self.rig.grid.size)
        self._measured = np.full(self.rig.grid.size, -self._keyframes)
        self._keyframe = 0

    def remember(self, belief: Belief) -> None:
        """Store the last scan."""
        ranges = belief.ranges.ravel()
        fired = ranges > 0
        self._ranges[fired] = ranges[fired]
        self._measured[fired] = self._keyframe
        self._keyframe += 1

    def demand(self, belief: Belief) -> Demand:
        """Return the budget's cells, drawn without replacement."""
        rng = np.random.default_rng(self._keyframe)
        variance = np.concatenate([self._variance(head, rng) for head in self.rig.grid.heads])
        # The highest log weights with Gumbel noise are such a draw.
        keys = np.log(variance + LEAST_M2) + rng.gumbel(size=len(variance))
        return Demand(layers=[[np.argsort(-keys, kind="stable")[: belief.budget]]])

    def _variance(self, head: Head, rng: np.random.Generator) -> Floats:
        """Return (n,) the variance of the members' predictions for the cells of one LiDAR, square
        metres; 0 while a member knows nothing.
        """
        from scipy.ndimage import distance_transform_edt

        ranges = self._ranges[head.cells].reshape(head.grid.shape)
        ages = self._keyframe - self._measured[head.cells].reshape(head.grid.shape)
        known = ages <= self._keyframes
        predictions = []
        for _ in range(MEMBERS):
            own = known & (rng.random(known.shape) < 0.5)
            if not own.any():
                return np.zeros(known.size)
            row, column = distance_transform_edt(~own, return_distances=False, return_indices=True)
            predictions.append(ranges[row, column])
        variance: Floats = np.var(predictions, axis=0).ravel()
        return variance
