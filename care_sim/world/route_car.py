"""A car that follows a route: its driver steers perfectly, and only its speed is decided."""

from care_sim.core.frames import Pose
from care_sim.world.route import Route


class RouteCar:
    """The middle of the car is on the route, `along` metres from its start, and points along it."""

    along: float
    pose: Pose
    """x, y, heading."""
    speed: float
    """m/s along the route."""

    def __init__(self, route: Route, speed: float):
        self._route = route
        self.along = 0.0
        self.pose = route.pose(0.0)
        self.speed = speed

    @property
    def yaw_rate(self) -> float:
        """rad/s, above 0 to the left."""
        return self._route.curvature(self.along) * self.speed

    def accelerate(self, acceleration: float, dt: float) -> None:
        """Drive on for `dt` seconds with an acceleration (m/s^2); a car at rest does not reverse.

        As highway-env moves its vehicles, the step is driven at the speed it begins with.
        """
        self.along += self.speed * dt
        self.pose = self._route.pose(self.along)
        self.speed = max(self.speed + acceleration * dt, 0.0)
