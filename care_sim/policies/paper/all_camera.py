"""A reserve for everything the camera sees, tracked or not."""

from care_sim.core.belief import Belief
from care_sim.core.residual import wedges
from care_sim.core.types import Demand
from care_sim.policies.base import Policy


class AllCamera(Policy):
    """The all-camera control of the paper (Sec. 5.1).

    It is history plus one reserve layer with the wedges of every camera detection. It lacks only
    the residual filter of CARE.
    """

    name = "all-camera"
    source = "CARE paper, Sec. 5.1"

    def demand(self, belief: Belief) -> Demand:
        """Hulls, then the wedges of all detections."""
        hulls = self.rig.hulls(belief.tracks.boxes)
        return Demand(hulls, [wedges(belief.detections, self.rig)])
