"""Motions outside the traffic: walkers, crossers, lane changes and straight ways."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.frames import Frame, Pose, turned


@dataclass(frozen=True)
class Walk:
    """A straight walk from `start` (x, y) along `heading` for `length_m`, begun at `starts_s`.

    The person gains speed at `acceleration` until `speed`. Metres, seconds, radians, world frame.
    """

    start: tuple[float, float]
    heading: float
    speed: float
    acceleration: float
    length_m: float
    starts_s: float = 0.0

    def setting_off(self, time: float) -> "Walk":
        """The same walk, begun at `time`."""
        return replace(self, starts_s=time)

    def covered(self, time: float) -> float:
        """Metres covered at `time`."""
        # a t^2 / 2 while speed is gained, then evenly; nothing before the start or past the end.
        moving = max(time - self.starts_s, 0.0)
        gaining = min(moving, self.speed / self.acceleration)
        distance = self.acceleration * gaining**2 / 2 + self.speed * (moving - gaining)
        return min(distance, self.length_m)

    def duration_to(self, distance: float) -> float:
        """Seconds from setting off until `distance` metres are covered."""
        # While speed is gained, distance = acceleration * time^2 / 2; afterwards it grows evenly.
        run_up = self.speed**2 / (2 * self.acceleration)
        if distance <= run_up:
            return float(np.sqrt(2 * distance / self.acceleration))
        return self.speed / self.acceleration + (distance - run_up) / self.speed

    def pose(self, time: float) -> Pose:
        """Pose at `time`."""
        way = self.covered(time)
        cos, sin = self._direction
        return self.start[0] + way * cos, self.start[1] + way * sin, self.heading

    def poses(self, times: Floats) -> Floats:
        """(n, 3) the poses at `times` (n,): those of `pose`, to the last bit."""
        moving = np.maximum(times - self.starts_s, 0.0)
        gaining = np.minimum(moving, self.speed / self.acceleration)
        # The squares are Python's: NumPy's round otherwise.
        squares = np.array([time**2 for time in gaining.tolist()])
        distance = self.acceleration * squares / 2 + self.speed * (moving - gaining)
        way = np.minimum(distance, self.length_m)
        cos, sin = self._direction
        poses = np.empty((len(times), 3))
        poses[:, 0], poses[:, 1] = self.start[0] + way * cos, self.start[1] + way * sin
        poses[:, 2] = self.heading
        return poses

    @cached_property
    def _direction(self) -> tuple[float, float]:
        return float(np.cos(self.heading)), float(np.sin(self.heading))


class Crosser:
    """Waits at the start of a walk and sets off when the ego has `lead_s` seconds left to its line.
    If other traffic would run over the crosser then, the crosser stays, as people do who see it
    come. `may_go` returns True if the way is free of other traffic.
    """

    walk: Walk
    went: bool | None
    """Whether it set off; None before the decision."""
    lead_s: float
    """Seconds before the ego's arrival at which it sets off."""

    def __init__(self, walk: Walk, lead_s: float, may_go: Callable[[Walk], bool]):
        self.walk = walk
        self.went = None
        self.lead_s = lead_s
        self._may_go = may_go

    def look(self, time: float, seconds_left: Callable[[], float]) -> None:
        """Decide at `time`, seconds from the start. Call it at every world step. `seconds_left`
        returns the ego's time to the line; it is slow and called only until the decision.
        """
        if self.went is not None:
            return
        left = seconds_left()
        if left > self.lead_s:
            return
        # World steps have a length: the exact moment to set off was within the last step.
        self.walk = self.walk.setting_off(time - (self.lead_s - left))
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
    """The side that it comes from, "left" or "right"."""
    along_m: float
    """Place of its line on the route."""
    way: str
    """Shape of the route while it comes into sight: "straight", "bend" or "turn"."""
    course: str
    """Result if the ego drives on as planned: "conflict", "near-miss" or "stop"."""
    occluder: str
    """Kind of the occluder."""
    occluder_reported: bool
    """Whether perception knows the occluder's class."""
    crosser: Crosser


@dataclass(frozen=True)
class LaneChange:
    """Drives along x at `speed_mps` from `start` (x, y) at time 0. From `begins_s` on it also moves
    across at `lateral_mps`, until it is at `to_y`. Metres, seconds, world frame.

    It keeps its heading, as the cut-ins of UN Regulation 157 do: their distances are measured
    between boxes along the road.
    """

    start: tuple[float, float]
    speed_mps: float
    begins_s: float
    lateral_mps: float
    to_y: float

    def pose(self, time: float) -> Pose:
        """Pose at `time`."""
        x, y = self.start
        way = self.to_y - y
        moved = min(self.lateral_mps * max(time - self.begins_s, 0.0), abs(way))
        return x + self.speed_mps * time, y + (moved if way > 0 else -moved), 0.0

    def poses(self, times: Floats) -> Floats:
        """(n, 3) the poses at `times` (n,): those of `pose`, to the last bit."""
        x, y = self.start
        way = self.to_y - y
        moved = np.minimum(self.lateral_mps * np.maximum(times - self.begins_s, 0.0), abs(way))
        poses = np.zeros((len(times), 3))
        poses[:, 0], poses[:, 1] = x + self.speed_mps * times, y + (moved if way > 0 else -moved)
        return poses


@dataclass(frozen=True)
class StraightWay:
    """Motion along `heading` at a constant `speed`, through `place` (x, y) at `time`. Metres,
    seconds, radians, world frame.
    """

    place: tuple[float, float]
    heading: float
    speed: float
    time: float

    def pose(self, time: float) -> Pose:
        """Pose at `time`."""
        way = self.speed * (time - self.time)
        return (
            self.place[0] + way * float(np.cos(self.heading)),
            self.place[1] + way * float(np.sin(self.heading)),
            self.heading,
        )


@dataclass(frozen=True)
class LinearMotion:
    """The `ego` (x, y, heading) at an instant, its `ego_rates` (3,) and the `rates` (m, 3) of
    bodies by id: metres and radians per second, in the world.
    """

    ego: Pose
    ego_rates: Floats
    rates: Floats

    def poses(self, poses: Floats, seconds: float) -> Floats:
        """Return (m, 7) the poses `seconds` later of bodies at `poses` (m, 7: x, y, z, quaternion
        x, y, z, w).
        """
        moved = poses.copy()
        moved[:, :2] += self.rates[:, :2] * seconds
        # The product with the quaternion of a turn about the world's z, (0, 0, sin, cos) of half
        # the angle. Without a turn it changes no bit.
        half = self.rates[:, 2] * seconds / 2
        cos, sin = np.cos(half), np.sin(half)
        x, y, z, w = poses[:, 3:].T
        moved[:, 3:] = np.column_stack(
            [cos * x - sin * y, cos * y + sin * x, cos * z + sin * w, cos * w - sin * z]
        )
        return moved

    def sensor(self, sensor: Frame, seconds: float) -> Frame:
        """Return a frame fixed on the ego `seconds` later."""
        ((x, y),) = self._carried(sensor, np.array([seconds])).tolist()
        return replace(sensor, x=x, y=y, yaw=sensor.yaw + float(self.ego_rates[2]) * seconds)

    def compensated(self, points: Floats, sensor: Frame, seconds: Floats) -> Floats:
        """Return (n, 3) `points` in the current frame `sensor`. They were measured `seconds` (n,)
        later, in the sensor's frame of that time.
        """
        turns = self.ego_rates[2] * seconds
        world = turned(sensor.vectors_to_world(points), turns)
        world[:, :2] += self._carried(sensor, seconds) - sensor.origin[:2]
        return sensor.vectors_to_local(world)

    def _carried(self, sensor: Frame, seconds: Floats) -> Floats:
        """Return (n, 2) the world places of a frame's origin on the ego `seconds` (n,) later."""
        middle = np.array(self.ego[:2])
        levers = np.tile(sensor.origin[:2] - middle, (len(seconds), 1))
        driven = self.ego_rates[:2] * seconds[:, None]
        carried: Floats = middle + driven + turned(levers, self.ego_rates[2] * seconds)
        return carried


def rates_between(before: Floats, after: Floats, seconds: float) -> Floats:
    """Return (n, 3) the rates that lead from poses (n, 3: x, y, heading) to others in `seconds`,
    turning the shorter way.
    """
    changes = after - before
    changes[:, 2] = np.remainder(changes[:, 2] + np.pi, 2 * np.pi) - np.pi
    rates: Floats = changes / seconds
    return rates
