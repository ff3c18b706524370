"""The vehicles of all lanes of a street, driven at once by the intelligent driver model (IDM).
`StreetTraffic` lays them along roads with bends and side streets.

The model (Treiber, Hennecke and Helbing 2000), its numbers and its order of operations are those of
highway-env's `IDMVehicle`, which `care_sim.world.traffic` asks vehicle by vehicle. Where nobody
changes lanes the motion is the same to the last bit, and a whole street costs less than one vehicle
there. One rule is ours: a driver who comes to rest stays there. Drivers of highway-env roll back at
some cm/s.
"""

import math
from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass, field

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers
from care_sim.world.motions import Crosser

MOST_MPS2 = 6.0
GAINING_MPS2 = 3.0
BRAKING_MPS2 = 5.0
STANDING_GAP_M = 10.0
"""Gap that an IDM driver leaves to a standing vehicle, from centre to centre, metres."""
TIME_GAP_S = 1.5
EXPONENT = 4.0


Other = tuple[float, float, int]
"""Place and speed of something else in a lane, such as the ego, and the number of the lane."""


class LaneFlow:
    """Vehicles that keep their lanes. Places are those of their middles, metres the way they
    drive.
    """

    places: Floats
    """(n,) metres."""
    speeds: Floats
    """(n,) m/s."""
    lanes: Integers
    """(n,) numbers of lanes."""

    def __init__(self, places: Sequence[float], wanted: Sequence[float], lanes: Sequence[int]):
        """Vehicles at `places` (n,) in `lanes` (n,). They drive at the speeds that they want,
        `wanted` (n,), m/s above 0.
        """
        self.places = np.array(places, float)
        self.speeds = np.array(wanted, float)
        self.lanes = np.array(lanes, np.int64)
        self._wanted = self.speeds.copy()

    def step(self, dt: float, others: Sequence[Other] = ()) -> None:
        """Let every driver decide, then move all by `dt` seconds. Drivers follow the `others` in
        their lane, too.
        """
        # The power is NumPy's, as compiled code may round it differently.
        free = 1 - (self.speeds / self._wanted) ** EXPONENT
        ahead = np.array(others, float).reshape(-1, 3)
        self.places, self.speeds = _moved(free, self.places, self.speeds, self.lanes, ahead, dt)


@compiled(error_model="numpy")
def _moved(
    free: Floats, places: Floats, speeds: Floats, lanes: Integers, others: Floats, dt: float
) -> tuple[Floats, Floats]:
    """(n,) places and speeds after `dt` seconds of drivers at `places` with `speeds`, who follow
    each other and `others` (m, 3) in their `lanes`. `free` are the shares of their acceleration
    that each would take on a free road.
    """
    moved = np.empty(len(places))
    for n in range(len(places)):
        # The vehicle ahead is the nearest with a greater place, the first of equally near ones.
        gap, lead_mps = math.inf, 0.0
        for other in range(len(places)):
            apart = places[other] - places[n]
            if lanes[other] == lanes[n] and 0.0 < apart < gap:
                gap, lead_mps = apart, speeds[other]
        for other in range(len(others)):
            apart = others[other, 0] - places[n]
            if others[other, 2] == lanes[n] and 0.0 < apart < gap:
                gap, lead_mps = apart, others[other, 1]
        closing = speeds[n] * (speeds[n] - lead_mps)
        wished = (
            STANDING_GAP_M
            + speeds[n] * TIME_GAP_S
            + closing / (2 * math.sqrt(GAINING_MPS2 * BRAKING_MPS2))
        )
        wanted = GAINING_MPS2 * free[n] - GAINING_MPS2 * (wished / gap) ** 2
        acceleration = min(max(wanted, -MOST_MPS2), MOST_MPS2)
        moved[n] = max(speeds[n] + acceleration * dt, 0.0)
    return places + speeds * dt, moved


@dataclass(frozen=True)
class Crossing:
    """Where a `crosser` crosses a lane: at `place_m` along it. The crosser is in the lane from
    `from_m` to `to_m` of the crosser's own way. Metres.
    """

    crosser: Crosser
    place_m: float
    from_m: float
    to_m: float

    def is_taken(self, time: float) -> bool:
        """Whether the crosser is in the lane at `time`."""
        walk = self.crosser.walk
        return bool(self.crosser.went) and self.from_m < walk.covered(time) < self.to_m


@dataclass(frozen=True)
class FlowingLane:
    """A lane with vehicles at first `places` that want to drive at `speeds`. `stop_m` is where they
    give way, inf if they need not. The ego is in the lane while it is between `ego_from_m` and
    `ego_to_m` along its route. Its place in the lane is then `ego_ahead_m` farther. Drivers stop
    for anybody in one of the `crossings`.
    """

    places: Sequence[float]
    speeds: Sequence[float]
    stop_m: float = np.inf
    ego_from_m: float = np.inf
    ego_to_m: float = np.inf
    ego_ahead_m: float = 0.0
    crossings: list[Crossing] = field(default_factory=list)

    def others(self, time: float, ego_m: float, ego_speed: float) -> list[tuple[float, float]]:
        """Return place and speed of everything but drivers in the lane at `time`, for an ego
        `ego_m` along its route.
        """
        found = self.stop_line()
        if self.ego_from_m <= ego_m < self.ego_to_m:
            found.append((ego_m + self.ego_ahead_m, ego_speed))
        # A crosser goes straight across: the speed along the lane is 0.
        found += [(one.place_m, 0.0) for one in self.crossings if one.is_taken(time)]
        return found

    def stop_line(self) -> list[tuple[float, float]]:
        """Return place and speed of the obstacle at the stop line, if drivers give way."""
        return [(self.stop_m, 0.0)] if math.isfinite(self.stop_m) else []


class StreetTraffic:
    """All lanes of a street. Drivers follow the vehicle ahead in their lane, the ego included, and
    stop for crossers. `poses_of` returns world poses (..., n, 3) of all vehicles, lane by lane, at
    places (..., n).
    """

    def __init__(self, lanes: Sequence[FlowingLane], poses_of: Callable[[Floats], Floats]):
        self.lanes = tuple(lanes)
        vehicles = [
            (*vehicle, number)
            for number, lane in enumerate(lanes)
            for vehicle in zip(lane.places, lane.speeds, strict=True)
        ]
        self.flow = LaneFlow(*np.array(vehicles, float).reshape(-1, 3).T)
        self._poses_of = poses_of
        self._poses = poses_of(self.flow.places)

    def poses_at(self, _time: float) -> Floats:
        """Return (n, 3) the world poses now of all vehicles, lane by lane."""
        return self._poses

    def step(self, dt: float, time: float, ego_m: float, ego_speed: float) -> None:
        """Move all by `dt` seconds, to `time`, with the ego `ego_m` along its route."""
        self.flow.step(dt, _numbered([one.others(time, ego_m, ego_speed) for one in self.lanes]))
        self._poses = self._poses_of(self.flow.places)

    def foreseen(self, steps: int, dt: float) -> Floats:
        """Return (steps, n, 3) future poses of all vehicles, every `dt` seconds, if neither the ego
        nor a crosser makes them brake.
        """
        flow, others = deepcopy(self.flow), _numbered([one.stop_line() for one in self.lanes])
        places = np.empty((steps, len(flow.places)))
        for row in places:
            row[:] = flow.places
            flow.step(dt, others)
        return self._poses_of(places)


def _numbered(others: Sequence[Sequence[tuple[float, float]]]) -> list[Other]:
    """Return what is in each lane, with the number of the lane."""
    return [(*one, number) for number, row in enumerate(others) for one in row]
