"""The truth about the coming keyframe of an environment's running episode."""

from collections.abc import Callable

from care_sim.frames import Floats
from care_sim.loop import ClosedLoop
from care_sim.types import Scan, Tracks


class EpisodeTruth:
    """A `care_sim.truth.Truth` that follows an environment from episode to episode."""

    def __init__(self, running: Callable[[], ClosedLoop]):
        self._running = running

    def boxes(self, tracks: Tracks) -> Floats:
        """(n, 7) true boxes, in the sensor frame, of the objects behind the tracks."""
        return self._running().true_boxes(tracks)

    def full_scan(self) -> Scan:
        """What a scan of every cell would return, before noise and dropout."""
        return self._running().full_scan()
