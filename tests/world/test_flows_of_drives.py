"""The traffic of drives, as they are played, beside vehicles of highway-env itself: the same to the
last bit, but for one rule. A driver of a flow who comes to rest stays there.
"""

import gymnasium
import numpy as np
import pytest
from highway_env.road.lane import StraightLane
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.objects import Obstacle

import care_sim
from care_sim.scenarios import drive
from care_sim.world.lane_flow import StreetTraffic


class EndlessLane(StraightLane):
    """Along x from 0, so that highway-env measures the places of a flow, and without ends."""

    def on_lane(self, *_, **__):
        return True

    def after_end(self, *_, **__):
        return False


class Driver(IDMVehicle):
    """A driver who stays where it comes to rest. highway-env's roll back, at up to 2 cm/s here."""

    def step(self, dt):
        super().step(dt)
        self.speed = max(self.speed, 0.0)


class HighwayLane:
    """A lane of a drive, driven by highway-env."""

    def __init__(self, lane):
        network = RoadNetwork()
        network.add_lane("a", "b", EndlessLane([0.0, 0.0], [1.0, 0.0], speed_limit=30.0))
        self.road = Road(network, np_random=np.random.RandomState(0))
        for place, speed in zip(lane.places, lane.speeds, strict=True):
            driver = Driver(self.road, [place, 0.0], 0.0, speed)
            # Bodies meet in PyBullet alone.
            driver.check_collisions = driver.collidable = driver.enable_lane_change = False
            self.road.vehicles.append(driver)

    @property
    def state(self):
        """(2, n) places and speeds."""
        return np.array([[one.position[0], one.speed] for one in self.road.vehicles]).T

    def step(self, dt, others):
        """Move on by `dt`; `others` are place and speed of what is in the lane besides."""
        self.road.objects = [Obstacle(self.road, [x, 0.0], 0.0, speed) for x, speed in others]
        self.road.act()
        self.road.step(dt)


class Beside(StreetTraffic):
    """The traffic of a drive, and that of highway-env beside it."""

    made = []  # noqa: RUF012 (emptied by the test)

    def __init__(self, lanes, poses_of):
        super().__init__(lanes, poses_of)
        self.theirs = [HighwayLane(lane) for lane in self.lanes]
        self.steps = self.braked = self.stopped_for = 0
        self.made.append(self)

    def step(self, dt, time, ego_m, ego_speed):
        told = [lane.others(time, ego_m, ego_speed) for lane in self.lanes]
        before = self.flow.speeds.copy()
        super().step(dt, time, ego_m, ego_speed)
        self.braked += (self.flow.speeds - before < -1.0 * dt).sum()
        for n, (lane, theirs, others) in enumerate(zip(self.lanes, self.theirs, told, strict=True)):
            theirs.step(dt, others)
            mine = self.flow.lanes == n
            assert np.array_equal([self.flow.places[mine], self.flow.speeds[mine]], theirs.state)
            self.stopped_for += any(one.is_taken(time) for one in lane.crossings)
        self.steps += 1


@pytest.mark.parametrize("seed", [5, 13, 18, 28])
def test_drivers_of_a_drive_move_as_those_of_highway_env(seed, monkeypatch):
    """The ego, which detects everything, brakes for people who come out. Drivers brake behind it,
    behind each other, before who crosses and before the main road.
    """
    monkeypatch.setattr(drive, "StreetTraffic", Beside)
    Beside.made.clear()
    with gymnasium.make("CARE-Drive-v0", budget=1.0) as env:
        policy = care_sim.make_policy("full", env)
        observation, _ = env.reset(seed=seed)
        over = False
        while not over:
            observation, _, ended, cut, _ = env.step(policy(observation))
            over = ended or cut
    (traffic,) = Beside.made
    assert traffic.steps > 500
    assert traffic.braked > 5
    assert traffic.stopped_for > 5
