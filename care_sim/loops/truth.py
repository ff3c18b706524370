"""What is true about the coming keyframe: for privileged policies and the scoring alone."""

from typing import Protocol

from care_sim.core.frames import Floats
from care_sim.core.types import Scan, Tracks


class Truth(Protocol):
    """The truth at the coming keyframe, as a privileged policy may ask for it.

    It never enters a `Belief`: `make_policy` hands it to subclasses of `PrivilegedPolicy` and to
    nobody else.
    """

    def boxes(self, tracks: Tracks) -> Floats:
        """(n, 7) true boxes, in the sensor frame, of the objects behind the tracks.

        A track without an object keeps its forecast.
        """
        ...

    def full_scan(self) -> Scan:
        """What a scan of every cell would return, before noise and dropout: `cells` are all cells,
        ascending.
        """
        ...
