"""CARE: the reserve goes to camera detections that no track explains."""

from dataclasses import replace

from care_sim.base.checks import check_flag
from care_sim.core.belief import Belief
from care_sim.core.residual import unexplained_layer
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import Policy


class Care(Policy):
    """The camera-residual reserve of the paper (Sec. 4.2, Algorithm 2).

    It is history plus the layer U of unexplained wedges. Without a camera detection it is the
    history policy, cell for cell.

    `yaw_compensation` says whether wedges, and the match with forecasts, are turned by the car's
    change of yaw since the picture (Sec. 5.5). Without it a late box is taken as if it were new.
    """

    name = "care"
    source = "CARE paper, Sec. 4.2, Algorithm 2"

    def __init__(self, rig: Rig, *, yaw_compensation: bool = True):
        super().__init__(rig)
        check_flag("yaw_compensation", yaw_compensation)
        self._yaw_compensation = yaw_compensation

    def demand(self, belief: Belief) -> Demand:
        """Hulls, then the wedges of the residual."""
        if not self._yaw_compensation:
            belief = replace(belief, detections=belief.detections.unturned())
        unexplained = unexplained_layer(belief, self.rig)
        return Demand(self.rig.hulls(belief.tracks.boxes), [unexplained])
