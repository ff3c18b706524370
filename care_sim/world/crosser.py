"""Somebody who waits until the ego is near, then goes."""

from collections.abc import Callable
from dataclasses import dataclass

from care_sim.core.frames import Pose
from care_sim.world.walker import Walk


class Crosser:
    """Waits at the beginning of a walk and sets off when the ego has `lead_s` seconds left to its
    line. Whom traffic would then run over waits on, as people do who see it come, and stays.

    `may_go` tells whether the way is free of other traffic.
    """

    walk: Walk
    went: bool | None
    """Whether it set off; None before the decision."""

    def __init__(self, walk: Walk, lead_s: float, may_go: Callable[[Walk], bool]):
        self.walk = walk
        self.went = None
        self._lead_s = lead_s
        self._may_go = may_go

    def look(self, time: float, seconds_left: Callable[[], float]) -> None:
        """Decide at `time`, seconds from the start; to be called at every world step.
        `seconds_left` tells what the ego has, and is asked only until the decision: it takes long.
        """
        if self.went is not None:
            return
        left = seconds_left()
        if left > self._lead_s:
            return
        # World steps are short but not endless: it set off a moment ago, when the time was right.
        self.walk = self.walk.setting_off(time - (self._lead_s - left))
        self.went = self._may_go(self.walk)

    def pose(self, time: float) -> Pose:
        """World pose at `time`."""
        if not self.went:
            return (*self.walk.start, self.walk.heading)
        return self.walk.pose(time)


@dataclass(frozen=True)
class Meeting:
    """A planned encounter of the ego with one body of its world. For scoring: it is truth."""

    body: int
    who: str
    """Its kind in the catalogue."""
    side: str
    """From which it comes, "left" or "right"."""
    along_m: float
    """Where on the route its line is."""
    way: str
    """How the route runs while it comes into sight: "straight", "bend" or "turn"."""
    course: str
    """What comes of it if the ego drives on as it means to: "conflict", "near-miss" or "stop"."""
    occluder: str
    """The kind of what hides it."""
    occluder_reported: bool
    """Whether perception knows the occluder's class."""
    crosser: Crosser
