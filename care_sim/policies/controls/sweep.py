"""A control: a sector that turns from keyframe to keyframe, without camera or tracks."""

import numpy as np

from care_sim.core.belief import Belief
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import Policy


class Sweep(Policy):
    """Fires whole columns, one after the other round the car, and goes on at the next keyframe
    where it stopped: a slow LiDAR that spins.
    """

    name = "sweep"
    tags = ("causal", "control")
    source = "own: a pattern that turns"
    is_pattern = True

    def __init__(self, rig: Rig):
        super().__init__(rig)
        cells = np.arange(rig.grid.size).reshape(rig.grid.shape)
        self._turn = cells.T.ravel()
        self.reset()

    def reset(self) -> None:
        """Begin at column 0, which is straight behind on a grid that goes all round."""
        self._first = self._next = 0

    def remember(self, belief: Belief) -> None:
        """Go on by the budget."""
        self._first = self._next
        self._next = (self._first + belief.budget) % len(self._turn)

    def demand(self, belief: Belief) -> Demand:
        """The budget's next cells."""
        places = (self._first + np.arange(belief.budget)) % len(self._turn)
        return Demand(layers=[[self._turn[places]]])
