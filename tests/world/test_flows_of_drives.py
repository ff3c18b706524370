"""The traffic of drives, as they are played, beside vehicles of highway-env itself.

All bits agree but the last ones: highway-env subtracts two products, `a * free - a * ratio`, where
a flow has one, `a * (free - ratio)`. And a driver of a flow who comes to rest stays there.
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
from care_sim.world.lane_flow import EXPONENT, GAINING_MPS2, MOST_MPS2, StreetTraffic, _following

SAME_M = 1e-9
"""What the last bits may grow to on a drive, metres and m/s."""


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

    def __init__(self, flow):
        network = RoadNetwork()
        network.add_lane("a", "b", EndlessLane([0.0, 0.0], [1.0, 0.0], speed_limit=30.0))
        self.road = Road(network, np_random=np.random.RandomState(0))
        self.wanted = flow.speeds.copy()
        for place, speed in zip(flow.places.tolist(), flow.speeds.tolist(), strict=True):
            driver = Driver(self.road, [place, 0.0], 0.0, speed)
            # Bodies meet in PyBullet alone.
            driver.check_collisions = driver.collidable = driver.enable_lane_change = False
            self.road.vehicles.append(driver)

    @property
    def state(self):
        """(2, n) places and speeds."""
        return np.array([[one.position[0], one.speed] for one in self.road.vehicles]).T

    def step(self, dt, others):
        """The accelerations; `others` are place and speed of what is in the lane besides."""
        self.road.objects = [Obstacle(self.road, [x, 0.0], 0.0, speed) for x, speed in others]
        self.road.act()
        self.road.step(dt)
        return np.array([one.action["acceleration"] for one in self.road.vehicles])


class Beside(StreetTraffic):
    """The traffic of a drive, and that of highway-env beside it."""

    made = []  # noqa: RUF012 (emptied by the test)

    def __init__(self, lanes):
        super().__init__(lanes)
        self.theirs = [HighwayLane(lane.flow) for lane in self.lanes]
        self.steps, self.braked = 0, 0
        self.made.append(self)

    def step(self, dt, ego_m, ego_speed):
        told = [lane.others(ego_m, ego_speed) for lane in self.lanes]
        super().step(dt, ego_m, ego_speed)
        for lane, theirs, others in zip(self.lanes, self.theirs, told, strict=True):
            if not len(theirs.wanted):
                continue
            places, speeds = theirs.state
            accelerations = theirs.step(dt, others)
            self.same_but_for_the_last_bits(theirs, places, speeds, accelerations, others)
            assert lane.flow.places == pytest.approx(theirs.state[0], abs=SAME_M)
            assert lane.flow.speeds == pytest.approx(theirs.state[1], abs=SAME_M)
            self.braked += (accelerations < -1.0).sum()
        self.steps += 1

    def same_but_for_the_last_bits(self, theirs, places, speeds, accelerations, others):
        """In highway-env's order of operations the compiled model gives its bits, where the limit
        of braking cuts nothing off.
        """
        free = 1 - (speeds / theirs.wanted) ** EXPONENT
        ahead = np.array(others, float).reshape(-1, 2)
        # With `free` 0 the ratio alone is left. A ratio that is cut off cannot be compared.
        following = _following(np.zeros(len(free)), places, speeds, ahead)
        whole = following > -MOST_MPS2
        wished = np.clip(GAINING_MPS2 * free + following, -MOST_MPS2, MOST_MPS2)
        assert np.array_equal(wished[whole], accelerations[whole])
        own = _following(free, places, speeds, ahead)
        assert np.abs(own - accelerations).max() < 1e-14


@pytest.mark.parametrize("seed", [5, 13, 18, 28])
def test_drivers_of_a_drive_move_as_those_of_highway_env(seed, monkeypatch):
    """The ego, which detects everything, brakes for people who come out. Drivers brake behind it,
    behind each other and before side streets.
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
