"""CARE with a second reserve layer: what tracks explain comes after what they do not."""

from care_sim.core.beliefs import Beliefs
from care_sim.core.residual import camera_layers_of
from care_sim.core.world_sets import WorldSets
from care_sim.policies.base import RowPolicy


class CarePriority(RowPolicy):
    """The priority-ordering variant of the paper (Sec. 4.2): CARE with the layers (U, M).

    The wedges of unexplained detections fill first, then those of explained ones. Nothing is
    forgotten.
    """

    name = "care-priority"
    source = "CARE paper, Sec. 4.2"

    def stages(self, beliefs: Beliefs) -> list[WorldSets]:
        """Hulls, then the layers (U, M)."""
        return [beliefs.hulls, *camera_layers_of(beliefs)]
