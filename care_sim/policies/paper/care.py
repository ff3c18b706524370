"""CARE: the reserve goes to camera detections that no track explains."""

from care_sim.base.checks import check_flag
from care_sim.core.beliefs import Beliefs
from care_sim.core.residual import unexplained_layer_of
from care_sim.core.rig import Rig
from care_sim.core.world_sets import WorldSets
from care_sim.policies.base import RowPolicy


class Care(RowPolicy):
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

    def stages(self, beliefs: Beliefs) -> list[WorldSets]:
        """Hulls, then the wedges of the residual."""
        if not self._yaw_compensation:
            beliefs = beliefs.unturned()
        return [beliefs.hulls, unexplained_layer_of(beliefs)]
