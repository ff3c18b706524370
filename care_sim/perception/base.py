"""What a detector is."""

from typing import Protocol

from care_sim.core.arrays import Integers
from care_sim.core.types import Detections
from care_sim.sensors.annotated import Annotations, Cloud


class Detector(Protocol):
    """What a loop calls at every keyframe."""

    def detect(self, cloud: Cloud, annotations: Annotations) -> tuple[Detections, Integers]:
        """Detections in the sensor frame from the returns of the fired cells, and (n,) the
        annotated object behind each, or NO_OBJECT, for privileged policies and the scoring.
        """
        ...
