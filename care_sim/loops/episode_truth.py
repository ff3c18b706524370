"""The truth about the coming keyframe of an environment's running episode."""

from collections.abc import Callable
from typing import Protocol

from care_sim.core.belief import Belief
from care_sim.core.frames import Floats
from care_sim.core.types import Scan, Tracks


class Loop(Protocol):
    """What the environments ask of a loop, besides its keyframes."""

    belief: Belief

    def true_boxes(self, tracks: Tracks) -> Floats:
        """(n, 7) true boxes of the objects behind forecasts."""
        ...

    def full_scan(self) -> Scan:
        """What every cell would return now."""
        ...


class EpisodeTruth:
    """A `care_sim.loops.truth.Truth` that follows an environment from episode to episode."""

    def __init__(self, running: Callable[[], Loop]):
        self._running = running

    def boxes(self, tracks: Tracks) -> Floats:
        """(n, 7) true boxes, in the sensor frame, of the objects behind the tracks."""
        return self._running().true_boxes(tracks)

    def full_scan(self) -> Scan:
        """What a scan of every cell would return, before noise and dropout."""
        return self._running().full_scan()
