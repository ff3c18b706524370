"""A reserve for everything the camera sees, tracked or not."""

from care_sim.core.beliefs import Beliefs
from care_sim.core.residual import wedges_of
from care_sim.core.world_sets import WorldSets
from care_sim.policies.base import RowPolicy


class AllCamera(RowPolicy):
    """The all-camera control of the paper (Sec. 5.1).

    It is history plus one reserve layer with the wedges of every camera detection. It lacks only
    the residual filter of CARE.
    """

    name = "all-camera"
    source = "CARE paper, Sec. 5.1"

    def stages(self, beliefs: Beliefs) -> list[WorldSets]:
        """Hulls, then the wedges of all detections."""
        return [beliefs.hulls, wedges_of(beliefs)]
