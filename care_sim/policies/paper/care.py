"""CARE: the reserve goes to camera detections that no track explains."""

from care_sim.core.belief import Belief
from care_sim.core.residual import camera_layers
from care_sim.core.types import Demand
from care_sim.policies.base import Policy


class Care(Policy):
    """The camera-residual reserve of the paper (Sec. 4.2, Algorithm 2).

    It is history plus the layer U of unexplained wedges. Without a camera detection it is the
    history policy, cell for cell.
    """

    name = "care"
    source = "CARE paper, Sec. 4.2, Algorithm 2"

    def demand(self, belief: Belief) -> Demand:
        """Hulls, then the wedges of the residual."""
        unexplained, _ = camera_layers(belief, self.rig)
        return Demand(self.rig.hulls(belief.tracks.boxes), [unexplained])
