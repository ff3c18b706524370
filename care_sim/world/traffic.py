"""Road, ego kinematics and traffic of highway-env, seen in a z-up world.

highway-env's y axis points down in its pictures; here y points left, so y and headings change sign
at this border and nowhere else. Lane 0 is the ego's; lanes are numbered to the left, negative to
the right.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from care_sim.core.frames import Pose
from care_sim.world.bodies import BodyKind
from care_sim.world.lane_flow import STANDING_GAP_M

# highway-env takes time to load: functions import it, and only a world with a road waits for it.
if TYPE_CHECKING:
    from highway_env.vehicle.kinematics import Vehicle

_ROAD_LENGTH_M = 1000.0
MAX_STEERING = np.deg2rad(35.0)
"""Largest steering angle of a passenger car. highway-env allows 60 degrees, at which a car slides
sideways.
"""
_NEAR_LANE_M = 1.0
"""Margin that highway-env adds to either side of a lane when it looks for vehicles ahead."""


class LaneKeeper(NamedTuple):
    """A vehicle that goes straight along x in the middle of its lane: `x`, speed and an IDM
    driver's wanted speed. The lane is given by its middle y, its start, and the half width within
    which highway-env counts vehicles as in the lane. Metres and m/s, highway-env's axes.
    """

    x: float
    speed: float
    wanted_mps: float
    lane_y: float
    lane_start_x: float
    lane_reach_m: float


class Traffic:
    """A straight road and the vehicles that drive on it.

    `directions` gives one entry per lane from right to left: +1 along the ego, -1 oncoming;
    `ego_lane` is the index of the ego's lane in it.
    """

    def __init__(
        self, directions: Sequence[int], ego_lane: int, lane_width: float, speed_limit: float
    ):
        # The first import of highway-env: its modules import each other, and two threads that enter
        # it at different ones get halves of it.
        from care_sim.world.lane_driver import LaneAlongX, empty_road

        # highway-env numbers the lanes of each direction apart, in the order in which they are
        # added; here all lanes have one numbering, from right to left.
        self._road = empty_road()
        self._lanes: list[tuple[str, str, int]] = []
        counts = {1: 0, -1: 0}
        for number, direction in enumerate(directions):
            y = -(number - ego_lane) * lane_width
            ends = ([-_ROAD_LENGTH_M, y], [_ROAD_LENGTH_M, y])
            start, end = ends if direction > 0 else ends[::-1]
            nodes = ("a", "b") if direction > 0 else ("b", "a")
            self._road.network.add_lane(
                *nodes, LaneAlongX(start, end, width=lane_width, speed_limit=speed_limit)
            )
            self._lanes.append((*nodes, counts[direction]))
            counts[direction] += 1
        self._ego_lane = ego_lane

    def add_ego(self, x: float, speed: float, kind: BodyKind) -> "RoadVehicle":
        """Add the car with the sensors, in lane 0 at `x`; `RoadVehicle.accelerate` drives it."""
        ego = self._make(x, 0, speed, kind, decides=False)
        ego.enter()
        ego.forget_lane()
        return ego

    def add_driver(self, x: float, lane: int, speed: float, kind: BodyKind) -> "RoadVehicle":
        """Add a vehicle that keeps its lane and follows the intelligent driver model (IDM). It
        drives and wants `speed` m/s.
        """
        vehicle = self._make(x, lane, speed, kind)
        vehicle.enter()
        return vehicle

    def add_parked_driver(
        self, x: float, lane: int, kind: BodyKind, target_speed: float
    ) -> "RoadVehicle":
        """Add an IDM driver who stands in `lane` until `pull_out`, then wants `target_speed`."""
        vehicle = self._make(x, lane, target_speed, kind)
        vehicle.stand()
        return vehicle

    def add_stop_line(self, x: float, lane: int) -> None:
        """Let drivers of `lane` come to rest with their centres at `x`, where they give way."""
        from care_sim.world.lane_driver import Obstacle

        key = self.lane_key(lane)
        road_lane = self._road.network.get_lane(key)
        ahead = STANDING_GAP_M * (1 if road_lane.end[0] > road_lane.start[0] else -1)
        # Drivers stop this gap before an obstacle, so the obstacle stands beyond the line. Only
        # drivers see it: nothing can hit it.
        obstacle = Obstacle(self._road, (x + ahead, road_lane.start[1]))
        obstacle.check_collisions = obstacle.collidable = False
        self._road.objects.append(obstacle)

    def lane_key(self, lane: int) -> tuple[str, str, int]:
        """highway-env's index of a lane."""
        return self._lanes[self._ego_lane + lane]

    def join(self, vehicle: "Vehicle") -> None:
        """Put a vehicle on the road."""
        self._road.vehicles.append(vehicle)

    def lane_keepers(
        self, vehicles: "Sequence[RoadVehicle]", seconds: float
    ) -> list[LaneKeeper] | None:
        """Return the lane keepers of `vehicles`, or None. The vehicles must be all on the road, in
        the order in which they joined it, and unable to leave their lanes along x for `seconds`.
        """
        found = [vehicle.keeping_lane(seconds) for vehicle in vehicles]
        keepers = [keeper for keeper in found if keeper is not None]
        all_keep = len(keepers) == len(found) == len(self._road.vehicles)
        if not all_keep or self._road.objects:
            return None
        in_order = zip(vehicles, self._road.vehicles, strict=True)
        return keepers if all(one.is_of(vehicle) for one, vehicle in in_order) else None

    def step(self, dt: float) -> None:
        """Let every driver decide, then move everything by `dt` seconds."""
        self._road.act()
        self._road.step(dt)

    def _make(
        self, x: float, lane: int, speed: float, kind: BodyKind, decides: bool = True
    ) -> "RoadVehicle":
        from care_sim.world.lane_driver import LaneDriver, StraightVehicle

        model = LaneDriver if decides else StraightVehicle
        key = self.lane_key(lane)
        road_lane = self._road.network.get_lane(key)
        along = float(road_lane.local_coordinates(np.array([x, road_lane.start[1]]))[0])
        vehicle = model.make_on_lane(self._road, key, along, speed)

        # PyBullet tells of collisions. highway-env would stop a vehicle that it thinks has crashed.
        vehicle.LENGTH, vehicle.WIDTH = kind.size[:2]
        vehicle.check_collisions = vehicle.collidable = False
        vehicle.enable_lane_change = False
        vehicle.MAX_STEERING_ANGLE = MAX_STEERING
        return RoadVehicle(vehicle, self)


class RoadVehicle:
    """One vehicle on the road, in the world frame."""

    def __init__(self, vehicle: "Vehicle", traffic: Traffic):
        self._vehicle = vehicle
        self._traffic = traffic

    @property
    def pose(self) -> Pose:
        """x, y, heading."""
        x, y = self._vehicle.position
        return float(x), -float(y), -float(self._vehicle.heading)

    def pose_at(self, _time: float) -> Pose:
        """Return the pose now, as the motion of an actor."""
        return self.pose

    @property
    def speed(self) -> float:
        """m/s along the heading."""
        return float(self._vehicle.speed)

    @property
    def yaw_rate(self) -> float:
        """Yaw rate in rad/s: 0, since only the ego reads it, which drives straight ahead."""
        return 0.0

    def is_of(self, vehicle: "Vehicle") -> bool:
        """Whether it is this one of highway-env."""
        return self._vehicle is vehicle

    def keeping_lane(self, seconds: float) -> LaneKeeper | None:
        """Return its lane keeper if it cannot leave its lane for `seconds`, else None."""
        from care_sim.world.lane_driver import not_zero

        vehicle, lane = self._vehicle, self._vehicle.lane
        x, speed = float(vehicle.position[0]), float(vehicle.speed)
        # A driver looks for another lane 2.5 m before the end of its own. highway-env slows
        # vehicles above its speed limit.
        way = max(abs(speed), vehicle.MAX_SPEED + 1.0) * seconds
        stays = abs(x) + way < _ROAD_LENGTH_M - lane.VEHICLE_LENGTH
        # Drivers alone have a lane that they want to be in.
        changes = vehicle.lane_index != getattr(vehicle, "target_lane_index", vehicle.lane_index)
        along_x = vehicle.heading == lane.heading == 0.0 and vehicle.position[1] == lane.start[1]
        if not stays or changes or not along_x:
            return None
        wanted = min(max(getattr(vehicle, "target_speed", 0.0), 0), lane.speed_limit)
        reach = lane.width / 2 + _NEAR_LANE_M
        start_x, lane_y = lane.start.tolist()
        return LaneKeeper(x, speed, abs(not_zero(wanted)), lane_y, start_x, reach)

    def enter(self) -> None:
        """Join the traffic: from now on the vehicle moves, and others see it."""
        self._traffic.join(self._vehicle)

    def forget_lane(self) -> None:
        """Stop looking up the nearest lane, which only drivers need."""
        self._vehicle.road = None

    def put(self, x: float, speed: float) -> None:
        """Put it farther along its lane, which runs along x, at a speed."""
        self._vehicle.position = np.array([x, self._vehicle.position[1]])
        self._vehicle.speed = speed

    def stand(self) -> None:
        """Lose all speed at once."""
        self._vehicle.speed = 0.0

    def accelerate(self, acceleration: float, dt: float) -> None:
        """Hold an acceleration (m/s^2) for the next step of `dt` seconds; a car at rest does not
        reverse.
        """
        # Brake at most to rest within the step: more would reverse.
        held = max(acceleration, -self.speed / dt)
        self._vehicle.act({"acceleration": held, "steering": 0.0})

    def pull_out(self, lane: int) -> None:
        """Join the traffic and change over to `lane`."""
        self._vehicle.target_lane_index = self._traffic.lane_key(lane)
        self.enter()
