"""The ego's side of a test, the target's motion, and when the test is over.

A test ends as the protocol's does: with a contact, when the ego stands before the target's way or
the target has left the ego's, or when the ego is no faster than the target that it follows.
"""

from dataclasses import dataclass

from care_sim.world.route import Route
from care_sim.world.world import Motion, World

CLEAR_M = 0.2
"""So far apart nothing touches: far more than the centimetres by which hulls are padded."""


@dataclass(frozen=True)
class Ego:
    """Speed in m/s, size in metres, and when its front hits if it does not brake."""

    speed: float
    length: float
    width: float
    hit_s: float

    def share(self, overlap: float) -> float:
        """How far the place at a share of the width lies from the middle, in the direction in which
        the share grows.
        """
        return self.width * (overlap - 0.5)


@dataclass(frozen=True)
class Crossing:
    """The ways of both cross.

    The ego's front is on the target's way from where its centre has gone `enter_m`, its rear off it
    at `leave_m`. The target has left the ego's way at `clear_s`.
    """

    enter_m: float
    leave_m: float
    clear_s: float

    def is_over(self, world: World) -> bool:
        """Whether no contact can follow."""
        gone = world.along_m
        stands_before = world.ego.speed == 0.0 and gone < self.enter_m
        return world.time >= self.clear_s or gone > self.leave_m or stands_before


@dataclass(frozen=True)
class Following:
    """The target goes ahead of the ego, in the end at `speed` m/s."""

    speed: float

    def is_over(self, world: World) -> bool:
        """Whether the ego is no faster than the target."""
        return world.ego.speed <= self.speed


@dataclass(frozen=True)
class Meeting:
    """The target's motion, and when the test is over; the middle line x of the way of a target that
    crosses, which obstructions stand by; the ego's route where it turns.
    """

    motion: Motion
    end: Crossing | Following
    line_x: float = 0.0
    route: Route | None = None
