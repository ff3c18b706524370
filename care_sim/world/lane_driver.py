"""Lanes along x and their vehicles: bit-identical to highway-env's, and cheaper."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from care_sim.base.extras import package_alone
from care_sim.core.arrays import Floats

# highway-env itself imports its environments, and these pandas, Matplotlib and pygame: a second.
with package_alone("highway_env"):
    from highway_env.road.lane import StraightLane
    from highway_env.road.road import Road, RoadNetwork
    from highway_env.utils import not_zero as not_zero
    from highway_env.vehicle.behavior import IDMVehicle
    from highway_env.vehicle.kinematics import Vehicle
    from highway_env.vehicle.objects import Obstacle as Obstacle

_DRAWS = np.random.RandomState(0)
"""highway-env's roads need a generator, and make one from the system's entropy by default. No
vehicle or behaviour draws from it.
"""


def empty_road() -> Road:
    """A road without lanes."""
    return Road(RoadNetwork(), np_random=_DRAWS)


class LaneAlongX(StraightLane):  # type: ignore[misc]
    """A lane from (-x, y) to (x, y) or back."""

    def local_coordinates(self, position: Sequence[float]) -> tuple[float, float]:
        """Return metres along the lane and to its side. Bit-identical to `StraightLane`, without
        its dot products of axes that are 0 and 1 or -1.
        """
        # The 0.0 stands for the product with the other axis: without it the side could be -0.0.
        x, y = position
        start_x, start_y, sign = self._origin
        return (float(x) - start_x) * sign, (float(y) - start_y) * sign + 0.0

    @cached_property
    def _origin(self) -> tuple[float, float, float]:
        return float(self.start[0]), float(self.start[1]), float(self.direction[0])


class StraightVehicle(Vehicle):  # type: ignore[misc]
    """A vehicle bit-identical to highway-env's that computes no sine or cosine while it goes
    straight ahead.
    """

    _headed: tuple[float, Floats] | None = None

    @property
    def direction(self) -> Floats:
        """(2,) unit vector along the heading."""
        if self._headed is None or self._headed[0] != self.heading:
            self._headed = self.heading, super().direction
        return self._headed[1]

    def step(self, dt: float) -> None:
        """Move by `dt` seconds."""
        if self.action["steering"] != 0.0 or self.impact is not None:
            super().step(dt)
            return
        # With its wheels straight a vehicle does not slip sideways, and its heading stays.
        self.clip_actions()
        self.position += self.speed * self.direction * dt
        self.speed += self.action["acceleration"] * dt
        self.on_state_update()


class LaneDriver(StraightVehicle, IDMVehicle):  # type: ignore[misc]
    """An IDM driver who, in the middle of a lane, neither steers nor looks for the nearest lane.
    Its numbers are plain floats, which NumPy would clip one by one.

    Bit-identical to highway-env's driver as long as it does not change lanes by itself and nothing
    reads its crash flag. Its timer and flag are not updated.
    """

    def act(self, action: dict[str, float] | str | None = None) -> None:
        """Decide on the next step."""
        # Drivers who change lanes, or reach the end of one, decide as highway-env does.
        lane = self.lane
        along = lane.local_coordinates(self.position)[0]
        if (
            self.lane_index != self.target_lane_index
            or lane.after_end(self.position, along)
            or not self._follows(lane)
        ):
            super().act(action)
            return
        ahead, _ = self.road.neighbour_vehicles(self, self.lane_index)
        wanted = self.acceleration(self, ahead)
        held = min(max(wanted, -self.ACC_MAX), self.ACC_MAX)
        self.action = {"steering": 0.0, "acceleration": held}

    def acceleration(
        self,
        ego_vehicle: Vehicle,
        front_vehicle: Vehicle | None = None,
        rear_vehicle: Vehicle | None = None,
    ) -> float:
        """Return the acceleration of `ego_vehicle` behind `front_vehicle`, if any, m/s^2."""
        # The powers are NumPy's: Python's round otherwise.
        limit = ego_vehicle.lane.speed_limit
        wanted_mps = min(max(ego_vehicle.target_speed, 0), limit)
        share = max(ego_vehicle.speed, 0) / abs(not_zero(wanted_mps))
        wish = self.COMFORT_ACC_MAX * (1 - np.power(share, self.DELTA))
        if front_vehicle:
            gap = self.desired_gap(ego_vehicle, front_vehicle)
            apart = not_zero(ego_vehicle.lane_distance_to(front_vehicle))
            wish -= self.COMFORT_ACC_MAX * np.power(gap / apart, 2)
        return float(wish)

    def steering_control(self, target_lane_index: tuple[str, str, int]) -> float:
        """Angle of the front wheels, radians."""
        # In the middle of a straight lane and along it, the steering that IDM computes is 0.
        follows = self._follows(self.road.network.get_lane(target_lane_index))
        return 0.0 if follows else float(super().steering_control(target_lane_index))

    def on_state_update(self) -> None:
        """Note the lane."""
        if not self._follows(self.lane):
            super().on_state_update()

    def _follows(self, lane: LaneAlongX) -> bool:
        return bool(
            self.heading == lane.heading and lane.local_coordinates(self.position)[1] == 0.0
        )
