"""CARE with a second reserve layer: what tracks explain comes after what they do not."""

from care_sim.core.belief import Belief
from care_sim.core.residual import camera_layers
from care_sim.core.types import Demand
from care_sim.policies.base import Policy


class CarePriority(Policy):
    """The priority-ordering variant of the paper (Sec. 4.2): CARE with the layers (U, M).

    The wedges of unexplained detections fill first, then those of explained ones. Nothing is
    forgotten.
    """

    name = "care-priority"
    source = "CARE paper, Sec. 4.2"

    def demand(self, belief: Belief) -> Demand:
        """Hulls, then the layers (U, M)."""
        return Demand(self.rig.hulls(belief.tracks.boxes), camera_layers(belief, self.rig))
